// A product of matrices for devices with local memory of their own, GPUs: weights [channels, terms]
// by columns whose numbers are gathered on the way, [terms, columns]. Convolutions are such products
// (a column is an output pixel), and fully connected layers of a batch (a column is an image).
//
// A work group computes a tile of channels and columns; where tiles are fewer than the device wants
// groups, the terms are cut in pieces as well, each a group's, and sum_pieces adds them up. The
// numbers of the next few terms are fetched while those at hand are multiplied.
//
// Defined by the host (product.cpp):
//   TILE_CHANNELS, TILE_COLUMNS  of a group's tile, TILE_TERMS of what it has in local memory;
//   ITEM_CHANNELS, ITEM_COLUMNS  of an item's part; multiples of 4;
//   FUSED  where the device multiplies and adds at once.
//
// The loop takes no addresses of what lies in registers (vload4, vstore4), has no condition around
// the sums and asks for the fused ones by name: without, it took half as long again on an H200.

#ifdef FUSED
#define PRODUCT_AND_SUM(a, b, c) fma(a, b, c)
#else
#define PRODUCT_AND_SUM(a, b, c) ((a) * (b) + (c))
#endif

#define UNROLL _Pragma("unroll")
#define ITEMS_ACROSS (TILE_COLUMNS / ITEM_COLUMNS)
#define ITEMS_DOWN (TILE_CHANNELS / ITEM_CHANNELS)
#define ITEMS (ITEMS_ACROSS * ITEMS_DOWN)
#define WEIGHTS (TILE_TERMS * TILE_CHANNELS / 4 / ITEMS)
#define NUMBERS (TILE_TERMS * TILE_COLUMNS / ITEMS)
#define TERMS_APART (ITEMS / TILE_COLUMNS)

// An item's part in fours, as far apart as they are of all items: neighbours read what lies side by side.
#define CHANNEL_OF(i) ((i) / 4 * (4 * ITEMS_DOWN) + down * 4 + (i) % 4)
#define COLUMN_OF(j) ((j) / 4 * (4 * ITEMS_ACROSS) + across * 4 + (j) % 4)

/// The weights and numbers of the terms from @p from on that this item fetches; beyond the end 0.
#define FETCH(from)                                                                      \
  {                                                                                      \
    UNROLL for (int i = 0; i < WEIGHTS; ++i) {                                            \
      const int at = me + i * ITEMS;                                                     \
      weight[i] = (from) + at / (TILE_CHANNELS / 4) < end                                 \
                      ? weights[(from) * (TILE_CHANNELS / 4) + at]                        \
                      : (float4)(0.0f);                                                  \
    }                                                                                    \
    UNROLL for (int i = 0; i < NUMBERS; ++i) {                                            \
      const int t = (from) + me / TILE_COLUMNS + i * TERMS_APART;                         \
      number[i] = t < end ? window[offsets[t]] : 0.0f;                                   \
    }                                                                                    \
  }

/// Where outputs are: of column n, row and column of an image, and its channels.
typedef struct {
  int pixels, out_w, image, plane, pitch, offset;
} Places;

int place_of(Places places, int n) {
  const int pixel = n % places.pixels;
  return places.offset + n / places.pixels * places.image + pixel / places.out_w * places.pitch +
         pixel % places.out_w;
}

/// max(least, sum + bias), or the sums of this piece alone where there are several. Groups along x:
/// blocks of channels, of the next columns, ...; along y: pieces.
///
/// @param input    A term of column n is offsets[term] behind the first one of its window, which is at
///                 image * in_image + y * in_row + x * stride.
/// @param weights  [blocks of channels, terms, TILE_CHANNELS], missing channels 0.
/// @param piece    Terms of a piece, a multiple of TILE_TERMS.
/// @param output   Outputs, or [pieces, blocks * TILE_CHANNELS, blocks * TILE_COLUMNS] sums.
__kernel __attribute__((reqd_work_group_size(ITEMS, 1, 1)))
void product(__global const float* restrict input, __global const float4* restrict weights,
             __global const float* restrict bias, __global const int* restrict offsets,
             __global float* output, int terms, int piece, int channels, int columns, int in_image,
             int in_row, int stride, int pixels, int out_w, int out_image, int out_plane,
             int out_pitch, int out_offset, float least) {
  __local float4 weight_tile[TILE_TERMS * TILE_CHANNELS / 4];
  __local float4 number_tile[TILE_TERMS * TILE_COLUMNS / 4];
  __local float* numbers = (__local float*)number_tile;
  const int me = (int)get_local_id(0);
  const int down = me / ITEMS_ACROSS, across = me % ITEMS_ACROSS;
  const int blocks = (channels + TILE_CHANNELS - 1) / TILE_CHANNELS;
  const int block = (int)get_group_id(0) % blocks;
  const int first_column = (int)get_group_id(0) / blocks * TILE_COLUMNS;
  const int first = (int)get_group_id(1) * piece, end = min(first + piece, terms);
  weights += block * terms * (TILE_CHANNELS / 4);

  // What this item gathers: each TERMS_APARTth term of one column. The last one stands for those that
  // are missing.
  const int gathered = min(first_column + me % TILE_COLUMNS, columns - 1);
  const int pixel = gathered % pixels;
  __global const float* window =
      input + gathered / pixels * in_image + pixel / out_w * in_row + pixel % out_w * stride;

  float sum[ITEM_CHANNELS][ITEM_COLUMNS];
#pragma unroll
  for (int i = 0; i < ITEM_CHANNELS; ++i)
#pragma unroll
    for (int j = 0; j < ITEM_COLUMNS; ++j) sum[i][j] = 0.0f;

  float4 weight[WEIGHTS];
  float number[NUMBERS];
  FETCH(first);
  for (int term = first; term < end; term += TILE_TERMS) {
#pragma unroll
    for (int i = 0; i < WEIGHTS; ++i) weight_tile[me + i * ITEMS] = weight[i];
#pragma unroll
    for (int i = 0; i < NUMBERS; ++i)
      numbers[(me / TILE_COLUMNS + i * TERMS_APART) * TILE_COLUMNS + me % TILE_COLUMNS] = number[i];
    barrier(CLK_LOCAL_MEM_FENCE);
    if (term + TILE_TERMS < end) FETCH(term + TILE_TERMS);
#pragma unroll
    for (int t = 0; t < TILE_TERMS; ++t) {
      float a[ITEM_CHANNELS], b[ITEM_COLUMNS];
#pragma unroll
      for (int i = 0; i < ITEM_CHANNELS; i += 4) {
        const float4 four = weight_tile[(t * TILE_CHANNELS + CHANNEL_OF(i)) / 4];
        a[i] = four.x, a[i + 1] = four.y, a[i + 2] = four.z, a[i + 3] = four.w;
      }
#pragma unroll
      for (int j = 0; j < ITEM_COLUMNS; j += 4) {
        const float4 four = number_tile[(t * TILE_COLUMNS + COLUMN_OF(j)) / 4];
        b[j] = four.x, b[j + 1] = four.y, b[j + 2] = four.z, b[j + 3] = four.w;
      }
#pragma unroll
      for (int i = 0; i < ITEM_CHANNELS; ++i)
#pragma unroll
        for (int j = 0; j < ITEM_COLUMNS; ++j) sum[i][j] = PRODUCT_AND_SUM(a[i], b[j], sum[i][j]);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }

  if (get_num_groups(1) > 1) {
    const int in_a_row = (int)get_num_groups(0) / blocks * TILE_COLUMNS;
    output += ((int)get_group_id(1) * blocks + block) * TILE_CHANNELS * in_a_row + first_column;
#pragma unroll
    for (int i = 0; i < ITEM_CHANNELS; ++i)
#pragma unroll
      for (int j = 0; j < ITEM_COLUMNS; j += 4)
        *(__global float4*)(output + CHANNEL_OF(i) * in_a_row + COLUMN_OF(j)) =
            (float4)(sum[i][j], sum[i][j + 1], sum[i][j + 2], sum[i][j + 3]);
    return;
  }
  const Places places = {pixels, out_w, out_image, out_plane, out_pitch, out_offset};
#pragma unroll
  for (int j = 0; j < ITEM_COLUMNS; ++j) {
    const int column = first_column + COLUMN_OF(j);
    if (column >= columns) continue;
    __global float* to = output + place_of(places, column);
#pragma unroll
    for (int i = 0; i < ITEM_CHANNELS; ++i) {
      const int channel = block * TILE_CHANNELS + CHANNEL_OF(i);
      if (channel < channels) to[channel * out_plane] = fmax(sum[i][j] + bias[channel], least);
    }
  }
}

/// Global ids (column, channel).
/// @param sums  [pieces, rows, in_a_row] of product.
__kernel void sum_pieces(__global const float* restrict sums, __global const float* restrict bias,
                         __global float* restrict output, int pieces, int rows, int in_a_row,
                         int columns, int pixels, int out_w, int out_image, int out_plane,
                         int out_pitch, int out_offset, float least) {
  const int column = (int)get_global_id(0), channel = (int)get_global_id(1);
  if (column >= columns) return;
  sums += channel * in_a_row + column;
  float sum = 0.0f;
#pragma unroll 8
  for (int piece = 0; piece < pieces; ++piece) sum += sums[piece * rows * in_a_row];
  const Places places = {pixels, out_w, out_image, out_plane, out_pitch, out_offset};
  output[place_of(places, column) + channel * out_plane] = fmax(sum + bias[channel], least);
}
