// mac_array: sums of products of 8 bits with sign for convolutions and fully connected layers: 14 output channels by 14 pixels of a row at a time.
//
// All inputs are kept, in words of 14 bytes, a row with the zeros left of it (those right of it are the next row's); weights come as words of
// 14 channels, group after group of channels, and are kept as long as their group needs them. For each group, row and tile of 14 pixels: over
// channels, rows of the filter that lie within the picture, and columns, a word of weights meets 14 neighbours a cycle. Sums go out while the
// next tile is computed. A fully connected layer is a picture of one pixel.
//
// Elements in are halves of words, inputs first; elements out are two sums of 32 bits. Set before, 16 bits each, the lowest byte first:
// channels, columns of the filter, rows of the picture, words of a row, rows out, tiles of a row, groups, zeros above, words of inputs, words of a
// group's weights, words of a channel's inputs, words of a channel's weights.
module mac_array (
    input wire clk,
    input wire reset,
    input wire set_valid,
    input wire [7:0] set_data,
    input wire in_valid,
    output wire in_ready,
    input wire [55:0] in_data,
    output wire out_valid,
    input wire out_ready,
    output wire [63:0] out_data
);
  localparam N = 14;        // channels, and pixels
  localparam WORD = 8 * N;
  localparam INPUTS = 13;   // address bits of half of the input words, even ones and odd ones
  localparam RING = 13;     // address bits of the weights
  localparam COUNT = 24;    // bits of a position in all weights of a layer
  localparam SUM = 29;      // 16,382 products, the most that fit (input_words), of -128 by -128

  reg [191:0] settings;
  always @(posedge clk) if (set_valid) settings <= {set_data, settings[191:8]};
  wire [13:0] channels = settings[13:0];
  wire [2:0] columns = settings[18:16];
  wire [6:0] rows = settings[38:32];
  wire [3:0] row_words = settings[51:48];
  wire [6:0] out_rows = settings[70:64];
  wire [3:0] tiles = settings[83:80];
  wire [9:0] groups = settings[105:96];
  wire [2:0] above = settings[114:112];
  wire [13:0] input_words = settings[141:128];
  wire [13:0] group_words = settings[157:144];
  wire [9:0] plane_words = settings[169:160];
  wire [5:0] filter_words = settings[181:176];

  // What comes in.
  reg half, full;
  reg [55:0] low;
  reg [13:0] inputs_in;
  reg [COUNT-1:0] weights_in, freed;
  reg [COUNT-1:0] kept;
  wire inputs_done = inputs_in == input_words;
  wire take = in_valid && in_ready;
  wire word_in = take && half;
  wire [WORD-1:0] word = {in_data, low};
  assign in_ready = !set_valid && (!inputs_done || !full);
  reg [WORD-1:0] even[0:(1<<INPUTS)-1];
  reg [WORD-1:0] odd[0:(1<<INPUTS)-1];
  reg [WORD-1:0] ring[0:(1<<RING)-1];
  always @(posedge clk) begin
    if (take) low <= in_data;
    if (word_in && !inputs_done && !inputs_in[0]) even[inputs_in[13:1]] <= word;
    if (word_in && !inputs_done && inputs_in[0]) odd[inputs_in[13:1]] <= word;
    if (word_in && inputs_done) ring[weights_in[RING-1:0]] <= word;
    kept <= weights_in - freed;
    full <= kept >= 24'd8188;  // two cycles late, which the four words' room allows
    if (reset) begin
      half <= 0;
      inputs_in <= 0;
      weights_in <= 0;
    end else if (take) begin
      half <= !half;
      if (half && !inputs_done) inputs_in <= inputs_in + 14'd1;
      if (half && inputs_done) weights_in <= weights_in + 24'd1;
    end
  end

  // The loops. Before each tile, in three cycles: which rows of the filter lie within the picture, and where their words begin.
  wire enable;
  reg [1:0] state;
  localparam [1:0] ROWS = 0, WORDS = 1, BEGIN = 2, RUN = 3;
  reg [9:0] group;
  reg [6:0] y;
  reg [3:0] tile;
  reg [2:0] first_ky, end_ky, ky, kx;
  reg [7:0] top;             // row of the picture that first_ky meets
  reg [10:0] start_word;
  reg [5:0] start_filter;
  reg [13:0] channel, at, next_at;                   // words of inputs: this step's, and the next channel's first
  reg [COUNT-1:0] group_at, here, next_here;         // words of weights: of the group's first, this step's, and the next channel's first
  wire [COUNT-1:0] missing = here - weights_in;      // below 0: it has come
  wire step = enable && state == RUN && missing[COUNT-1] && inputs_done;
  wire last_kx = kx == columns - 3'd1, last_ky = ky == end_ky, last_channel = channel == channels - 14'd1;
  wire last_tile = tile == tiles - 4'd1, last_y = y == out_rows - 7'd1;
  wire last = last_kx && last_ky && last_channel;
  wire [7:0] below = {1'b0, rows} + {5'b0, above} - {1'b0, y} - 8'd1;  // the last row of the filter within the picture
  always @(posedge clk)
    if (reset) begin
      state <= ROWS;
      group <= 0;
      y <= 0;
      tile <= 0;
      group_at <= 0;
      freed <= 0;
    end else
      case (state)
        ROWS: begin
          first_ky <= y < {4'b0, above} ? above - y[2:0] : 3'd0;
          end_ky <= below < {5'b0, columns} ? below[2:0] : columns - 3'd1;
          top <= y < {4'b0, above} ? 8'd0 : {1'b0, y} - {5'b0, above};
          if (group != groups && !set_valid) state <= WORDS;
        end
        WORDS: begin
          start_word <= {3'b0, top} * {7'b0, row_words};
          start_filter <= {3'b0, first_ky} * {3'b0, columns};
          state <= BEGIN;
        end
        BEGIN: begin
          channel <= 0;
          ky <= first_ky;
          kx <= 0;
          at <= {3'b0, start_word} + {10'b0, tile};
          next_at <= {3'b0, start_word} + {10'b0, tile} + {4'b0, plane_words};
          here <= group_at + {18'b0, start_filter};
          next_here <= group_at + {18'b0, start_filter} + {18'b0, filter_words};
          state <= RUN;
        end
        default:
        if (step) begin
          kx <= last_kx ? 3'd0 : kx + 3'd1;
          here <= last_kx && last_ky ? next_here : here + 24'd1;
          if (last_kx) begin
            ky <= last_ky ? first_ky : ky + 3'd1;
            at <= last_ky ? next_at : at + {10'b0, row_words};
          end
          if (last_kx && last_ky) begin
            channel <= channel + 14'd1;
            next_at <= next_at + {4'b0, plane_words};
            next_here <= next_here + {18'b0, filter_words};
          end
          if (last_tile && last_y) freed <= here;
          if (last) begin
            state <= ROWS;
            tile <= last_tile ? 4'd0 : tile + 4'd1;
            if (last_tile) y <= last_y ? 7'd0 : y + 7'd1;
            if (last_tile && last_y) begin
              group <= group + 10'd1;
              group_at <= group_at + {10'b0, group_words};
              freed <= group_at + {10'b0, group_words};
            end
          end
        end
      endcase

  // 1: addresses. 2: words. 3: 28 neighbours, a place further each column of the filter. 4: products. 5: sums.
  reg [INPUTS-1:0] even_at_1, odd_at_1;
  reg [RING-1:0] here_1;
  wire [13:0] at_next = at + 14'd1;
  reg [WORD-1:0] even_2, odd_2, weights_2, weights_3;
  reg [2*WORD-1:0] near_3;
  reg swaps_1, swaps_2, starts_1, starts_2;
  reg [4:1] first, ends;
  reg [4:1] valid;
  reg complete_5;
  always @(posedge clk) begin
    if (enable) begin
      even_at_1 <= at_next[13:1];
      odd_at_1 <= at[13:1];
      here_1 <= here[RING-1:0];
      even_2 <= even[even_at_1];
      odd_2 <= odd[odd_at_1];
      weights_2 <= ring[here_1];
      {swaps_2, swaps_1} <= {swaps_1, at[0]};
      {starts_2, starts_1} <= {starts_1, kx == 0};
      weights_3 <= weights_2;
      if (valid[2])
        near_3 <= !starts_2 ? near_3 >> 8 : swaps_2 ? {even_2, odd_2} : {odd_2, even_2};
      first <= {first[3:1], channel == 0 && ky == first_ky && kx == 0};
      ends <= {ends[3:1], last};
    end
    if (reset) {complete_5, valid} <= 0;
    else if (enable) {complete_5, valid} <= {valid[4] && ends[4], valid[3:1], step};
  end
  reg [N*N*SUM-1:0] shown;
  reg [6:0] left;  // elements of it
  wire load = complete_5 && left == 0;
  assign enable = !complete_5 || left == 0;
  genvar m, n;
  generate
    for (m = 0; m < N; m = m + 1) begin : channel_of
      wire signed [7:0] weight = weights_3[m*8+:8];
      for (n = 0; n < N; n = n + 1) begin : pixel
        localparam AT = (m * N + n) * SUM;
        wire signed [7:0] input_3 = near_3[n*8+:8];
        reg signed [15:0] product;
        reg [SUM-1:0] sum;
        always @(posedge clk) begin
          if (enable) begin
            product <= weight * input_3;
            if (valid[4]) sum <= (first[4] ? {SUM{1'b0}} : sum) + {{(SUM-16){product[15]}}, product};
          end
        end
        if (m * N + n < N * N - 2) begin : shifted
          always @(posedge clk) if (load) shown[AT+:SUM] <= sum; else if (out_ready) shown[AT+:SUM] <= shown[AT+2*SUM+:SUM];
        end else begin : at_end
          always @(posedge clk) if (load) shown[AT+:SUM] <= sum;
        end
      end
    end
  endgenerate
  assign out_valid = left != 0;
  assign out_data = {{(32-SUM){shown[2*SUM-1]}}, shown[SUM+:SUM], {(32-SUM){shown[SUM-1]}}, shown[0+:SUM]};
  always @(posedge clk)
    if (reset) left <= 0;
    else if (load) left <= 7'd98;
    else if (out_valid && out_ready) left <= left - 7'd1;
  wire unused = &{1'b0, settings, at_next[0]};
endmodule
