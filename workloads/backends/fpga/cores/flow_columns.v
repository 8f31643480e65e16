// For each pixel, in raster order: five sums of columns, summed over columns x-26 to x+25, those beyond the picture repeating the first or
// last. The last 25 windows of a row come out while the first columns of the next go in: `start` gathers the next row's first window
// meanwhile.
module flow_columns (
    input wire clk,
    input wire reset,
    input wire [11:0] width,
    input wire [11:0] height,
    input wire in_valid,
    output wire in_ready,
    input wire [119:0] in_data,  // five of 24 bits
    output reg out_valid,
    input wire out_ready,
    output wire [149:0] out_data  // five of 30 bits
);
  localparam WINDOW = 52;
  localparam [11:0] LATE = 25;  // columns that a sum waits for

  wire enable = !out_valid || out_ready;
  reg [11:0] row, column;
  wire below = row == height;
  wire step = enable && (below || in_valid);
  assign in_ready = enable && !below;
  wire last_column = column == width - 12'd1;
  wire last_step = below && column == LATE - 12'd1;
  reg [5:0] slot;
  always @(posedge clk)
    if (reset) begin
      row <= 0;
      column <= 0;
      slot <= 0;
    end else if (step) begin
      column <= last_column || last_step ? 12'd0 : column + 12'd1;
      if (last_step) row <= 0;
      else if (last_column) row <= row + 12'd1;
      slot <= slot == WINDOW - 1 ? 6'd0 : slot + 6'd1;
    end

  // 1: the column that enters and the one of 52 steps ago.
  reg [119:0] ring[0:63];
  reg [119:0] ring_1, in_1;
  reg [5:0] slot_1;
  reg [11:0] x_1;
  reg valid_1, ends_1, begins_1, starts_1, follows_1;
  always @(posedge clk) begin
    if (enable) begin
      ring_1 <= ring[slot];
      in_1 <= in_data;
      slot_1 <= slot;
      ends_1 <= last_column;
      starts_1 <= column == 0;
      begins_1 <= column == LATE;
      follows_1 <= column < LATE;  // windows of the row before
      x_1 <= column < LATE ? width - LATE + column : column - LATE;
    end
    if (reset) valid_1 <= 0;
    else if (enable) valid_1 <= step;
  end
  always @(posedge clk) if (enable && valid_1) ring[slot_1] <= in_1;
  reg middle_1;  // whether this step completes a window
  always @(posedge clk) if (enable) middle_1 <= column >= LATE || row != 0;

  // 2: what enters and leaves a window. 3: what changes. Then the sums.
  reg begins_2, starts_2, middle_2, valid_2, begins_3, starts_3, middle_3, valid_3;
  always @(posedge clk) begin
    if (enable) begin
      {begins_3, begins_2} <= {begins_2, begins_1};
      {starts_3, starts_2} <= {starts_2, starts_1};
      {middle_3, middle_2} <= {middle_2, middle_1};
    end
    if (reset) {out_valid, valid_3, valid_2} <= 0;
    else if (enable) {out_valid, valid_3, valid_2} <= {valid_3 && middle_3, valid_2, valid_1};
  end
  genvar i;
  generate
    for (i = 0; i < 5; i = i + 1) begin : sum
      wire [23:0] in = in_1[i*24+:24];
      reg [23:0] next_first, first, last, entering_2, leaving_2;
      reg [29:0] plus_2, minus_2, change_3, in_3, total, start;
      wire [29:0] wide = {{6{in[23]}}, in};
      wire [29:0] more_3 = start + in_3;
      assign out_data[i*30+:30] = total;
      always @(posedge clk)
        if (enable) begin
          if (valid_1) begin
            if (starts_1) next_first <= in;
            if (begins_1) first <= next_first;
            if (ends_1) last <= in;
          end
          plus_2 <= starts_1 ? (wide << 5) - (wide << 2) : wide;  // 28 - 1 times
          minus_2 <= starts_1 ? wide : 30'd0;
          entering_2 <= follows_1 ? last : in;
          leaving_2 <= x_1 > 12'd26 ? ring_1[i*24+:24] : first;
          change_3 <= {{6{entering_2[23]}}, entering_2} - {{6{leaving_2[23]}}, leaving_2};
          in_3 <= plus_2 - minus_2;
          if (valid_3) begin
            start <= starts_3 ? in_3 : more_3;
            total <= begins_3 ? more_3 : total + change_3;
          end
        end
    end
  endgenerate
endmodule
