// For each pixel, in raster order: the products xx, xy, yy, xt, yt of its column, summed over rows y-26 to y+25, those beyond the picture
// repeating the first or last row: the first row's products count 27 times in the first sum, then a row enters and a row leaves.
module flow_rows #(
    parameter MAX_WIDTH = 640,
    parameter ADDRESS = 10,
    parameter RING_ADDRESS = 16
) (
    input wire clk,
    input wire reset,
    input wire [11:0] width,
    input wire [11:0] height,
    input wire in_valid,
    output wire in_ready,
    input wire [26:0] in_data,  // dt, dy, dx of 9 bits
    output reg out_valid,
    input wire out_ready,
    output reg [119:0] out_data  // five sums of 24 bits
);
  localparam WINDOW = 52;
  localparam [12:0] LATE = 25;  // rows that a sum waits for

  wire enable = !out_valid || out_ready;
  reg [12:0] row;
  reg [11:0] column;
  wire below = row >= {1'b0, height};
  wire step = enable && (below || in_valid);
  assign in_ready = enable && !below;
  wire last_column = column == width - 12'd1;
  wire last_row = row == {1'b0, height} + LATE - 13'd1;
  reg [RING_ADDRESS-1:0] slot;  // (row modulo 52) * width + column
  reg [5:0] slot_row;
  always @(posedge clk)
    if (reset) begin
      row <= 0;
      column <= 0;
      slot <= 0;
      slot_row <= 0;
    end else if (step) begin
      column <= last_column ? 12'd0 : column + 12'd1;
      slot <= slot + 1;
      if (last_column) begin
        row <= last_row ? 13'd0 : row + 13'd1;
        slot_row <= last_row || slot_row == WINDOW - 1 ? 6'd0 : slot_row + 6'd1;
        if (last_row || slot_row == WINDOW - 1) slot <= 0;
      end
    end

  // 1: the row that enters (the last one again, below the picture) and the one that leaves (the first one, as long as it counts).
  reg [26:0] ring[0:WINDOW*MAX_WIDTH-1];
  reg [26:0] line[0:MAX_WIDTH-1];
  reg [26:0] ring_1, line_1, in_1;
  reg [RING_ADDRESS-1:0] slot_1;
  reg [ADDRESS-1:0] column_1, column_2, column_3, column_4, column_5;
  reg below_1, first_1, leaves_1, sums_1, valid_1;
  wire [RING_ADDRESS-1:0] leaving = row < WINDOW ? {{(RING_ADDRESS-12){1'b0}}, column} : slot;
  always @(posedge clk) begin
    if (enable) begin
      ring_1 <= ring[leaving];
      line_1 <= line[column[ADDRESS-1:0]];
      in_1 <= in_data;
      slot_1 <= slot;
      column_1 <= column[ADDRESS-1:0];
      below_1 <= below;
      first_1 <= row == 0;
      leaves_1 <= row > LATE;
      sums_1 <= row >= LATE;
    end
    if (reset) valid_1 <= 0;
    else if (enable) valid_1 <= step;
  end
  wire [26:0] entering_1 = below_1 ? line_1 : in_1;
  always @(posedge clk)
    if (enable && valid_1) begin
      ring[slot_1] <= entering_1;
      line[column_1] <= entering_1;
    end

  // 2: both. 3: their products. 4: what the first row weighs. 5: what changes; the sums so far.
  reg [26:0] entering_2, leaving_2;
  reg first_2, first_3, first_5, leaves_2, leaves_3, sums_2, sums_3, sums_4, sums_5;
  reg first_4, valid_2, valid_3, valid_4, valid_5;
  always @(posedge clk) begin
    if (enable) begin
      entering_2 <= entering_1;
      leaving_2 <= ring_1;
      {column_5, column_4, column_3, column_2} <= {column_4, column_3, column_2, column_1};
      {first_5, first_4, first_3, first_2} <= {first_4, first_3, first_2, first_1};
      {leaves_3, leaves_2} <= {leaves_2, leaves_1};
      {sums_5, sums_4, sums_3, sums_2} <= {sums_4, sums_3, sums_2, sums_1};
    end
    if (reset) {valid_5, valid_4, valid_3, valid_2} <= 0;
    else if (enable) {valid_5, valid_4, valid_3, valid_2} <= {valid_4, valid_3, valid_2, valid_1};
  end
  reg [119:0] sums[0:MAX_WIDTH-1];
  reg [119:0] before_5;
  wire [119:0] after_5;
  always @(posedge clk) begin
    if (enable) before_5 <= sums[column_4];
    if (enable && valid_5) sums[column_5] <= after_5;
  end
  genvar i;
  generate
    for (i = 0; i < 5; i = i + 1) begin : product
      localparam A = i == 0 || i == 1 || i == 3 ? 0 : 9;         // x x y x y
      localparam B = i == 0 ? 0 : i == 1 || i == 2 ? 9 : 18;     // x y y t t
      wire signed [8:0] entering_a = entering_2[A+:9], entering_b = entering_2[B+:9];
      wire signed [8:0] leaving_a = leaving_2[A+:9], leaving_b = leaving_2[B+:9];
      reg signed [17:0] enters, leaves;
      reg [23:0] plus_4, minus_4, change_5;
      wire [23:0] wide = {{6{enters[17]}}, enters};
      always @(posedge clk)
        if (enable) begin
          enters <= entering_a * entering_b;
          leaves <= leaving_a * leaving_b;
          plus_4 <= first_3 ? (wide << 5) - (wide << 2) : wide;  // 28 - 1 times
          minus_4 <= first_3 ? wide : leaves_3 ? {{6{leaves[17]}}, leaves} : 24'd0;
          change_5 <= plus_4 - minus_4;
        end
      assign after_5[i*24+:24] = (first_5 ? 24'd0 : before_5[i*24+:24]) + change_5;
    end
  endgenerate

  always @(posedge clk) begin
    if (enable) out_data <= after_5;
    if (reset) out_valid <= 0;
    else if (enable) out_valid <= valid_5 && sums_5;
  end
endmodule
