// optical_flow: dense Lucas-Kanade over windows of 52x52, a pair of pixels (the next picture's in the high byte) a cycle.
//
// Derivatives, products summed down each column, sums of those along each row, two equations solved. Exact up to the determinant and its
// numerators; quotients as f32 from 27 leading bits of each, cut off after 24: within 2^-22 of the exact value, which is the only difference
// from the definition. u in the low half. Pictures are 26 columns wide or more.
module optical_flow (
    input wire clk,
    input wire reset,
    input wire [11:0] width,
    input wire [11:0] height,
    input wire in_valid,
    output wire in_ready,
    input wire [15:0] in_data,
    output wire out_valid,
    input wire out_ready,
    output wire [63:0] out_data
);
  wire taps_valid, taps_ready;
  wire [143:0] taps;
  window #(.BITS(16), .R(1), .MAX_WIDTH(640), .ADDRESS(10), .REPLICATE(1)) around (
      .clk(clk), .reset(reset), .width(width), .height(height),
      .in_valid(in_valid), .in_ready(in_ready), .in_data(in_data),
      .out_valid(taps_valid), .out_ready(taps_ready), .out_data(taps));

  // dx, dy and dt of the pixel in the middle.
  reg derived_valid;
  wire derived_ready;
  assign taps_ready = !derived_valid || derived_ready;
  reg [8:0] dx, dy, dt;
  always @(posedge clk) begin
    if (taps_ready) begin
      dx <= {1'b0, taps[5*16+:8]} - {1'b0, taps[3*16+:8]};
      dy <= {1'b0, taps[7*16+:8]} - {1'b0, taps[1*16+:8]};
      dt <= {1'b0, taps[4*16+8+:8]} - {1'b0, taps[4*16+:8]};
    end
    if (reset) derived_valid <= 0;
    else if (taps_ready) derived_valid <= taps_valid;
  end
  wire unused = &{1'b0, taps};

  wire down_valid, down_ready, sums_valid, sums_ready;
  wire [119:0] down;
  wire [149:0] sums;
  flow_rows rows (
      .clk(clk), .reset(reset), .width(width), .height(height),
      .in_valid(derived_valid), .in_ready(derived_ready), .in_data({dt, dy, dx}),
      .out_valid(down_valid), .out_ready(down_ready), .out_data(down));
  flow_columns columns (
      .clk(clk), .reset(reset), .width(width), .height(height),
      .in_valid(down_valid), .in_ready(down_ready), .in_data(down),
      .out_valid(sums_valid), .out_ready(sums_ready), .out_data(sums));
  flow_solve solver (
      .clk(clk), .reset(reset),
      .in_valid(sums_valid), .in_ready(sums_ready), .in_data(sums),
      .out_valid(out_valid), .out_ready(out_ready), .out_data(out_data));
endmodule
