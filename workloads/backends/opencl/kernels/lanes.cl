// Vectors at the address of any element; included by who needs it.
//
// That is vload and vstore. But PoCL 3.1 makes 16 instructions of a vstore16 of bytes, and one of a
// vector whose type says how it lies. Nor does it inline by itself, and a function that is called
// does not see which of its arguments are constants: with both, gaussian_blur took 148 us of a
// picture of 640x480 where it takes 41 (two cores, AVX-512).

#ifndef INLINE  // Defined as nothing by tests/oclgrind.sh.
#define INLINE __attribute__((always_inline))
#endif

#ifdef POCL_DEVICE_ADDRESS_BITS  // Which PoCL defines.
typedef uchar8 Bytes8 __attribute__((aligned(1)));
typedef uchar16 Bytes16 __attribute__((aligned(1)));
typedef short8 Shorts8 __attribute__((aligned(2)));
typedef short16 Shorts16 __attribute__((aligned(2)));
typedef ushort16 Ushorts16 __attribute__((aligned(2)));
typedef float8 Floats8 __attribute__((aligned(4)));
#define LOAD(type, p) (*(__global const type*)(p))
#define STORE(type, p, value) (*(__global type*)(p) = (value))
#else
#define LOAD(type, p) LOAD_##type(p)
#define STORE(type, p, value) STORE_##type(p, value)
#define LOAD_Bytes8(p) vload8(0, p)
#define LOAD_Bytes16(p) vload16(0, p)
#define LOAD_Shorts8(p) vload8(0, p)
#define LOAD_Ushorts16(p) vload16(0, p)
#define STORE_Bytes16(p, value) vstore16(value, 0, p)
#define STORE_Shorts16(p, value) vstore16(value, 0, p)
#define STORE_Ushorts16(p, value) vstore16(value, 0, p)
#define STORE_Floats8(p, value) vstore8(value, 0, p)
#endif
