// gaussian_blur: the binomial of 5x5, (sum + 128) >> 8, border reflect-101. A pixel of 8 bits a cycle.
module gaussian_blur (
    input wire clk,
    input wire reset,
    input wire [11:0] width,
    input wire [11:0] height,
    input wire in_valid,
    output wire in_ready,
    input wire [7:0] in_data,
    output reg out_valid,
    input wire out_ready,
    output reg [7:0] out_data
);
  wire enable = !out_valid || out_ready;
  wire taps_valid;
  wire [199:0] taps;
  window #(.BITS(8), .R(2), .MAX_WIDTH(640), .ADDRESS(10)) around (
      .clk(clk), .reset(reset), .width(width), .height(height),
      .in_valid(in_valid), .in_ready(in_ready), .in_data(in_data),
      .out_valid(taps_valid), .out_ready(enable), .out_data(taps));

  // 1: 1 4 6 4 1 down each column. 2: the same across, in two sums.
  reg [11:0] down[0:4];
  genvar i;
  generate
    for (i = 0; i < 5; i = i + 1) begin : sums
      wire [7:0] a = taps[i*8+:8], b = taps[(5+i)*8+:8], c = taps[(10+i)*8+:8];
      wire [7:0] d = taps[(15+i)*8+:8], e = taps[(20+i)*8+:8];
      always @(posedge clk)
        if (enable)
          down[i] <= ({4'b0, a} + {4'b0, e}) + ({2'b0, b, 2'b0} + {2'b0, d, 2'b0}) + ({3'b0, c, 1'b0} + {2'b0, c, 2'b0});
    end
  endgenerate
  reg [15:0] outer, inner;
  wire [15:0] sum = outer + inner;  // at most 255 * 256 + 128
  reg valid_1, valid_2;
  always @(posedge clk) begin
    if (enable) begin
      outer <= ({4'b0, down[0]} + {4'b0, down[4]}) + 16'd128;
      inner <= ({2'b0, down[1], 2'b0} + {2'b0, down[3], 2'b0}) + ({3'b0, down[2], 1'b0} + {2'b0, down[2], 2'b0});
      out_data <= sum[15:8];
    end
    if (reset) {out_valid, valid_2, valid_1} <= 0;
    else if (enable) {out_valid, valid_2, valid_1} <= {valid_2, valid_1, taps_valid};
  end
  wire unused = &{1'b0, sum[7:0]};
endmodule
