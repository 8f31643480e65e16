// 255 where the picture is brighter than the level.
__kernel void threshold(__global const uchar* image, __global uchar* mask, uchar level) {
  const size_t i = get_global_id(1) * PIRT_WIDTH + get_global_id(0);
  mask[i] = image[i] > level ? 255 : 0;
}
