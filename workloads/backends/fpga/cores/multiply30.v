// A signed product of 30 bits by 30, three cycles later, of four products that a DSP block of 18x18 takes.
module multiply30 (
    input wire clk,
    input wire enable,
    input wire [29:0] a,
    input wire [29:0] b,
    output reg [59:0] product
);
  wire signed [15:0] a_low = {1'b0, a[14:0]}, b_low = {1'b0, b[14:0]};
  wire signed [15:0] a_high = {a[29], a[29:15]}, b_high = {b[29], b[29:15]};
  reg signed [31:0] low, high, cross_ab, cross_ba;
  reg [32:0] crosses;
  reg [59:0] outer;
  always @(posedge clk)
    if (enable) begin
      low <= a_low * b_low;
      high <= a_high * b_high;
      cross_ab <= a_high * b_low;
      cross_ba <= a_low * b_high;
      crosses <= {cross_ab[31], cross_ab} + {cross_ba[31], cross_ba};
      outer <= {high[29:0], low[29:0]};  // the low product is positive and below 2^30
      product <= outer + {{12{crosses[32]}}, crosses, 15'b0};
    end
  wire unused = &{1'b0, low[31:30], high[31:30]};
endmodule
