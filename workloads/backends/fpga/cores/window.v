// The (2R+1) x (2R+1) neighbourhood of each pixel of a picture, in raster order, one a cycle.
//
// Borders are mirrored without the edge pixel (reflect-101), or repeated (REPLICATE). A picture takes (height + R) * width + R steps: rows
// below the last one are stepped through without input, and the last R columns of a row come out while the next row goes in. Pictures may
// follow one another without a reset. width and height stay as they are from reset on and are R + 1 or more.
module window #(
    parameter BITS = 8,
    parameter R = 1,
    parameter MAX_WIDTH = 640,
    parameter ADDRESS = 10,
    parameter REPLICATE = 0
) (
    input wire clk,
    input wire reset,
    input wire [11:0] width,
    input wire [11:0] height,
    input wire in_valid,
    output wire in_ready,
    input wire [BITS-1:0] in_data,
    output reg out_valid,
    input wire out_ready,
    output reg [(2*R+1)*(2*R+1)*BITS-1:0] out_data  // tap (j, i) at (j * (2R+1) + i) * BITS
);
  localparam SIDE = 2 * R + 1;
  localparam COLUMN = SIDE * BITS;
  localparam [11:0] RADIUS = R;

  wire enable = !out_valid || out_ready;

  // Step (row, column) reads pixel (row, column) and completes the neighbourhood of (row - R, column - R).
  reg [11:0] row, column;
  wire below = row >= height;
  wire step = enable && (below || in_valid);
  wire last_column = column == width - 12'd1;
  wire last_step = row == height + RADIUS && column == RADIUS - 12'd1;
  assign in_ready = enable && !below;

  always @(posedge clk)
    if (reset) begin
      row <= 0;
      column <= 0;
    end else if (step) begin
      column <= last_column || last_step ? 12'd0 : column + 12'd1;
      if (last_step) row <= 0;
      else if (last_column) row <= row + 12'd1;
    end

  // 1: the pixels above it, and how far the row in the middle is from the borders.
  reg [2*R*BITS-1:0] lines[0:MAX_WIDTH-1];
  reg [2*R*BITS-1:0] above_1;
  reg [BITS-1:0] pixel_1;
  reg [11:0] row_1, column_1, after_1;
  reg valid_1;
  always @(posedge clk) begin
    if (enable) begin
      above_1 <= lines[column[ADDRESS-1:0]];
      pixel_1 <= in_data;
      row_1 <= row;
      column_1 <= column;
      after_1 <= height - 12'd1 + RADIUS - row;  // rows after the one in the middle
    end
    if (reset) valid_1 <= 0;
    else if (enable) valid_1 <= step;
  end
  wire [COLUMN-1:0] raw_1 = {pixel_1, above_1};
  always @(posedge clk) if (enable && valid_1) lines[column_1[ADDRESS-1:0]] <= raw_1[COLUMN-1:BITS];

  // 2: the column, its rows beyond the borders replaced.
  wire [11:0] before_1 = row_1 - RADIUS;
  wire [COLUMN-1:0] mirrored_1;
  border #(.BITS(BITS), .R(R), .REPLICATE(REPLICATE)) rows (
      .taps(raw_1), .ahead(before_1), .behind(after_1), .mirrored(mirrored_1));
  reg [COLUMN-1:0] column_2;
  reg [11:0] x_2;
  reg valid_2, has_middle_2;
  always @(posedge clk) begin
    if (enable) begin
      column_2 <= mirrored_1;
      x_2 <= column_1 >= RADIUS ? column_1 - RADIUS : width - RADIUS + column_1;
      has_middle_2 <= column_1 >= RADIUS ? row_1 >= RADIUS : row_1 > RADIUS;
    end
    if (reset) valid_2 <= 0;
    else if (enable) valid_2 <= valid_1;
  end

  // 3: the columns side by side, the newest last.
  reg [SIDE*COLUMN-1:0] columns_3;
  reg [11:0] x_3, right_3;
  reg valid_3;
  always @(posedge clk) begin
    if (enable && valid_2) begin
      columns_3 <= {column_2, columns_3[SIDE*COLUMN-1:COLUMN]};
      x_3 <= x_2;
      right_3 <= width - 12'd1 - x_2;
    end
    if (reset) valid_3 <= 0;
    else if (enable) valid_3 <= valid_2 && has_middle_2;
  end

  // 4: the columns beyond the borders replaced; taps in rows.
  wire [SIDE*COLUMN-1:0] mirrored_3;
  border #(.BITS(COLUMN), .R(R), .REPLICATE(REPLICATE)) across (
      .taps(columns_3), .ahead(x_3), .behind(right_3), .mirrored(mirrored_3));
  genvar i, j;
  generate
    for (j = 0; j < SIDE; j = j + 1) begin : in_row
      for (i = 0; i < SIDE; i = i + 1) begin : tap
        always @(posedge clk)
          if (enable) out_data[(j*SIDE+i)*BITS+:BITS] <= mirrored_3[i*COLUMN+j*BITS+:BITS];
      end
    end
  endgenerate
  always @(posedge clk)
    if (reset) out_valid <= 0;
    else if (enable) out_valid <= valid_3;
endmodule
