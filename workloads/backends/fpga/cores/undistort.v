// undistort: for each pixel the picture at a position of 1/32 pixel, bilinear, (sum + 512) / 1024, 0 outside. An element a cycle.
//
// Element n has pixel n of the picture and, from row `lead` on, the position of pixel n - lead * width, as a difference in 8 bits from what a
// straight map would have after its left neighbour, (+32, 0), or after the row's begin above it, (0, +32). The last 128 rows of the picture
// are kept in four memories, by even and odd rows and columns, so that four neighbours are read at once. Rows behind the picture's last
// element have no pixels. Set before: x and y above the first position (3 bytes each), lead (2 bytes), the lowest byte of each first.
module undistort (
    input wire clk,
    input wire reset,
    input wire [11:0] width,
    input wire [11:0] height,
    input wire set_valid,
    input wire [7:0] set_data,
    input wire in_valid,
    output wire in_ready,
    input wire [23:0] in_data,  // pixel, difference of x, difference of y
    output reg out_valid,
    input wire out_ready,
    output reg [7:0] out_data
);
  localparam HALF = 320;  // columns of a memory
  localparam ROWS = 64;   // rows of a memory

  reg [63:0] settings;
  always @(posedge clk) if (set_valid) settings <= {set_data, settings[63:8]};
  wire [11:0] lead = settings[59:48];

  wire enable = !out_valid || out_ready;
  assign in_ready = enable;
  reg [11:0] row, column;
  wire step = enable && in_valid;
  wire last_column = column == width - 12'd1;
  wire last_row = row == height + lead - 12'd1;
  always @(posedge clk)
    if (reset) begin
      row <= 0;
      column <= 0;
    end else if (step) begin
      column <= last_column ? 12'd0 : column + 12'd1;
      if (last_column) row <= last_row ? 12'd0 : row + 12'd1;
    end

  // 1: the element, what its position has more than the one it follows. 2: its position; the pixel's place.
  reg [7:0] pixel_1, pixel_2;
  reg [19:0] right_1, down_1;
  reg [6:0] row_1;
  reg [9:0] column_1;
  reg [14:0] to_2;
  reg [1:0] odd_2;
  reg begins_1, first_1, valid_1, maps_1, valid_2, keeps_2;
  always @(posedge clk) begin
    if (enable) begin
      pixel_1 <= in_data[7:0];
      right_1 <= {{12{in_data[15]}}, in_data[15:8]} + (column == 0 ? 20'd0 : 20'd32);
      down_1 <= {{12{in_data[23]}}, in_data[23:16]} + (column == 0 ? 20'd32 : 20'd0);
      row_1 <= row[6:0];
      column_1 <= column[9:0];
      begins_1 <= column == 0;
      first_1 <= row == lead;
      maps_1 <= row >= lead;
      pixel_2 <= pixel_1;
      to_2 <= ({1'b0, row_1[6:1], 8'b0} + {3'b0, row_1[6:1], 6'b0}) + {6'b0, column_1[9:1]};
      odd_2 <= {row_1[0], column_1[0]};
    end
    if (reset) {keeps_2, valid_2, valid_1} <= 0;
    else if (enable) {keeps_2, valid_2, valid_1} <= {valid_1, valid_1 && maps_1, step};
  end
  reg [19:0] x_2, y_2, begin_x, begin_y;
  wire [19:0] x_1 = (!begins_1 ? x_2 : first_1 ? settings[19:0] : begin_x) + right_1;
  wire [19:0] y_1 = (!begins_1 ? y_2 : first_1 ? settings[43:24] : begin_y) + down_1;
  always @(posedge clk)
    if (enable && valid_1 && maps_1) begin
      x_2 <= x_1;
      y_2 <= y_1;
      if (begins_1) {begin_y, begin_x} <= {y_1, x_1};
    end

  // 3: which place of which memory, what lies outside. 4, 5: the places.
  wire [14:0] xi = x_2[19:5], yi = y_2[19:5];  // with sign
  wire [14:0] xi_next = xi + 15'd1, yi_next = yi + 15'd1;
  reg [14:0] xi_3, yi_3, xi_next_3, yi_next_3;
  reg [9:0] fractions_3;  // of y, x
  wire left_in = !xi_3[14] && xi_3[13:0] < {2'b0, width}, right_in = !xi_next_3[14] && xi_next_3[13:0] < {2'b0, width};
  wire top_in = !yi_3[14] && yi_3[13:0] < {2'b0, height}, bottom_in = !yi_next_3[14] && yi_next_3[13:0] < {2'b0, height};
  reg [5:0] even_row_3, odd_row_3;
  reg [8:0] even_column_3, odd_column_3;
  reg [13:0] how_4, how_5, how_6;   // fy, fx, odd row, odd column, which neighbours are inside
  reg [14:0] even_4, odd_4, even_column_4, odd_column_4;
  reg [14:0] place[0:3];  // odd row, odd column
  reg [7:0] valid;        // 3 to 10
  always @(posedge clk) begin
    if (enable) begin
      even_row_3 <= yi_next[6:1];
      odd_row_3 <= yi[6:1];
      even_column_3 <= xi_next[9:1];
      odd_column_3 <= xi[9:1];
      xi_3 <= xi;
      yi_3 <= yi;
      xi_next_3 <= xi_next;
      yi_next_3 <= yi_next;
      fractions_3 <= {y_2[4:0], x_2[4:0]};
      even_4 <= {1'b0, even_row_3, 8'b0} + {3'b0, even_row_3, 6'b0};
      odd_4 <= {1'b0, odd_row_3, 8'b0} + {3'b0, odd_row_3, 6'b0};
      even_column_4 <= {6'b0, even_column_3};
      odd_column_4 <= {6'b0, odd_column_3};
      how_4 <= {fractions_3, bottom_in && right_in, bottom_in && left_in, top_in && right_in, top_in && left_in};
      place[0] <= even_4 + even_column_4;
      place[1] <= even_4 + odd_column_4;
      place[2] <= odd_4 + even_column_4;
      place[3] <= odd_4 + odd_column_4;
      how_5 <= how_4;
      how_6 <= how_5;
    end
    if (reset) {out_valid, valid} <= 0;
    else if (enable) {out_valid, valid} <= {valid, valid_2};
  end
  reg [1:0] odd_3, odd_4b, odd_5, odd_6;  // row, column
  always @(posedge clk) if (enable) {odd_6, odd_5, odd_4b, odd_3} <= {odd_5, odd_4b, odd_3, yi[0], xi[0]};

  // 6: what the memories hold there.
  reg [7:0] found[0:3];
  genvar m;
  generate
    for (m = 0; m < 4; m = m + 1) begin : memory
      localparam [1:0] WHICH = m;
      reg [7:0] pixels[0:ROWS*HALF-1];
      always @(posedge clk) begin
        if (enable) found[m] <= pixels[place[m]];
        if (enable && keeps_2 && odd_2 == WHICH) pixels[to_2] <= pixel_2;
      end
    end
  endgenerate

  // 7: the neighbours and how far right of the left ones. 8: products across. 9: their sums, each with half of what rounds. 10: products down.
  reg [7:0] near[0:3];  // bottom, right
  reg [5:0] right_7, left_7, bottom_9, top_9;
  reg [4:0] down_7, down_8;
  reg [13:0] left[0:1], right[0:1], across[0:1];
  generate
    for (m = 0; m < 4; m = m + 1) begin : neighbour
      localparam [1:0] AT = m;
      always @(posedge clk) if (enable) near[m] <= how_6[m] ? found[AT ^ odd_6] : 8'd0;
    end
    for (m = 0; m < 2; m = m + 1) begin : line
      always @(posedge clk)
        if (enable) begin
          left[m] <= {6'b0, near[2*m]} * {8'b0, left_7};
          right[m] <= {6'b0, near[2*m+1]} * {8'b0, right_7};
          across[m] <= left[m] + right[m] + 14'd16;  // 16 * 32, the sum of the weights down, is 512
        end
    end
  endgenerate
  reg [19:0] top_10, bottom_10;
  wire [19:0] sum_10 = top_10 + bottom_10;
  always @(posedge clk)
    if (enable) begin
      right_7 <= {1'b0, how_6[8:4]};
      left_7 <= 6'd32 - {1'b0, how_6[8:4]};
      down_7 <= how_6[13:9];
      down_8 <= down_7;
      bottom_9 <= {1'b0, down_8};
      top_9 <= 6'd32 - {1'b0, down_8};
      top_10 <= {6'b0, across[0]} * {14'b0, top_9};
      bottom_10 <= {6'b0, across[1]} * {14'b0, bottom_9};
      out_data <= sum_10[17:10];
    end
  wire unused = &{1'b0, sum_10[19:18], sum_10[9:0]};
endmodule
