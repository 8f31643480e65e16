// Two quotients by one divisor, STEPS cycles later: floor(a * 2^(STEPS-1) / by), for a < 2 * by. `side` travels beside them.
module divide #(
    parameter STEPS = 25,
    parameter BITS = 27,
    parameter SIDE = 1
) (
    input wire clk,
    input wire enable,
    input wire [BITS-1:0] by,
    input wire [BITS-1:0] a,
    input wire [BITS-1:0] b,
    input wire [SIDE-1:0] side,
    output wire [STEPS-1:0] a_quotient,
    output wire [STEPS-1:0] b_quotient,
    output wire [SIDE-1:0] side_out
);
  // Entry k: before step k.
  reg [BITS-1:0] divisor[1:STEPS];
  reg [BITS:0] a_rest[1:STEPS], b_rest[1:STEPS];
  reg [STEPS-1:0] a_bits[1:STEPS], b_bits[1:STEPS];
  reg [SIDE-1:0] sides[1:STEPS];
  genvar k;
  generate
    for (k = 0; k < STEPS; k = k + 1) begin : step
      localparam K = k == 0 ? 1 : k;
      wire [BITS:0] d = {1'b0, k == 0 ? by : divisor[K]};
      wire [BITS:0] ra = k == 0 ? {1'b0, a} : a_rest[K];
      wire [BITS:0] rb = k == 0 ? {1'b0, b} : b_rest[K];
      wire [BITS+1:0] a_less = {1'b0, ra} - {1'b0, d};
      wire [BITS+1:0] b_less = {1'b0, rb} - {1'b0, d};
      wire a_fits = !a_less[BITS+1], b_fits = !b_less[BITS+1];
      always @(posedge clk)
        if (enable) begin
          divisor[k+1] <= d[BITS-1:0];
          a_rest[k+1] <= {a_fits ? a_less[BITS-1:0] : ra[BITS-1:0], 1'b0};
          b_rest[k+1] <= {b_fits ? b_less[BITS-1:0] : rb[BITS-1:0], 1'b0};
          a_bits[k+1] <= {k == 0 ? {(STEPS-1){1'b0}} : a_bits[K][STEPS-2:0], a_fits};
          b_bits[k+1] <= {k == 0 ? {(STEPS-1){1'b0}} : b_bits[K][STEPS-2:0], b_fits};
          sides[k+1] <= k == 0 ? side : sides[K];
        end
      wire unused = &{1'b0, a_less[BITS], b_less[BITS]};
    end
  endgenerate
  assign a_quotient = a_bits[STEPS];
  assign b_quotient = b_bits[STEPS];
  assign side_out = sides[STEPS];
  wire unused = &{1'b0, divisor[STEPS], a_rest[STEPS], b_rest[STEPS]};
endmodule
