// The cores of one bitstream side by side, one of them connected: what is synthesized to see whether they fit together. The SDRAM's controller,
// the DMA and the bridge would stand around it.
module vision (
    input wire clk,
    input wire reset,
    input wire [2:0] select,
    input wire [11:0] width,
    input wire [11:0] height,
    input wire set_valid,
    input wire [7:0] set_data,
    input wire in_valid,
    output wire in_ready,
    input wire [23:0] in_data,
    output wire out_valid,
    input wire out_ready,
    output wire [63:0] out_data
);
  wire [5:0] in_readies, out_valids;
  wire [5:0] one = 6'd1 << select;
  wire [63:0] outs[0:5];
  assign in_ready = |(in_readies & one);
  assign out_valid = |(out_valids & one);
  assign out_data = select > 3'd5 ? 64'd0 : outs[select];
  assign outs[0][63:8] = 0;
  assign outs[1][63:8] = 0;
  assign outs[2][63:32] = 0;
  assign outs[3][63:8] = 0;
  assign outs[4][63:32] = 0;

  gaussian_blur c0 (
      .clk(clk), .reset(reset), .width(width), .height(height),
      .in_valid(in_valid && one[0]), .in_ready(in_readies[0]), .in_data(in_data[7:0]),
      .out_valid(out_valids[0]), .out_ready(out_ready && one[0]), .out_data(outs[0][7:0]));
  convolution c1 (
      .clk(clk), .reset(reset), .width(width), .height(height), .set_valid(set_valid && one[1]), .set_data(set_data),
      .in_valid(in_valid && one[1]), .in_ready(in_readies[1]), .in_data(in_data[7:0]),
      .out_valid(out_valids[1]), .out_ready(out_ready && one[1]), .out_data(outs[1][7:0]));
  sobel c2 (
      .clk(clk), .reset(reset), .width(width), .height(height),
      .in_valid(in_valid && one[2]), .in_ready(in_readies[2]), .in_data(in_data[7:0]),
      .out_valid(out_valids[2]), .out_ready(out_ready && one[2]), .out_data(outs[2][31:0]));
  undistort c3 (
      .clk(clk), .reset(reset), .width(width), .height(height), .set_valid(set_valid && one[3]), .set_data(set_data),
      .in_valid(in_valid && one[3]), .in_ready(in_readies[3]), .in_data(in_data),
      .out_valid(out_valids[3]), .out_ready(out_ready && one[3]), .out_data(outs[3][7:0]));
  feature_score c4 (
      .clk(clk), .reset(reset), .width(width), .height(height),
      .in_valid(in_valid && one[4]), .in_ready(in_readies[4]), .in_data(in_data[7:0]),
      .out_valid(out_valids[4]), .out_ready(out_ready && one[4]), .out_data(outs[4][31:0]));
  optical_flow c5 (
      .clk(clk), .reset(reset), .width(width), .height(height),
      .in_valid(in_valid && one[5]), .in_ready(in_readies[5]), .in_data(in_data[15:0]),
      .out_valid(out_valids[5]), .out_ready(out_ready && one[5]), .out_data(outs[5]));
endmodule
