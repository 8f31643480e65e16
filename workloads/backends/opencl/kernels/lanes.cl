// Vectors at the address of any element, as vload and vstore have them; included by who needs it.
//
// PoCL 3.1 makes one instruction of these, and of a vstore16 of bytes 16 of them. Nor does it inline
// by itself, and a function that is called does not see which of its arguments are constants: with
// both, gaussian_blur took 148 us of a picture of 640x480 where it takes 41 (two cores, AVX-512).

#ifndef INLINE  // Defined as nothing by tests/oclgrind.sh.
#define INLINE __attribute__((always_inline))
#endif

typedef uchar16 Bytes16 __attribute__((aligned(1)));
typedef short8 Shorts8 __attribute__((aligned(2)));
typedef short16 Shorts16 __attribute__((aligned(2)));
typedef float8 Floats8 __attribute__((aligned(4)));

#define LOAD(type, p) (*(__global const type*)(p))
#define STORE(type, p, value) (*(__global type*)(p) = (value))
