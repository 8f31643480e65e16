// The square root of a number of 2 * BITS bits, cut off, a bit a cycle; `side` travels beside it.
module square_root #(
    parameter BITS = 31,
    parameter SIDE = 1
) (
    input wire clk,
    input wire enable,
    input wire [2*BITS-1:0] of,
    input wire [SIDE-1:0] side,
    output wire [BITS-1:0] root,
    output wire [SIDE-1:0] side_out
);
  // Entry k: after k bits of the root, which are `roots`; `rest` is what their square leaves, below twice the root + 1.
  reg [2*BITS-1:0] numbers[1:BITS];
  reg [BITS+1:0] rests[1:BITS];
  reg [BITS-1:0] roots[1:BITS];
  reg [SIDE-1:0] sides[1:BITS];
  genvar k;
  generate
    for (k = 0; k < BITS; k = k + 1) begin : step
      localparam K = k == 0 ? 1 : k;
      wire [2*BITS-1:0] number = k == 0 ? of : numbers[K];
      wire [BITS+1:0] rest = k == 0 ? {(BITS+2){1'b0}} : rests[K];
      wire [BITS-1:0] so_far = k == 0 ? {BITS{1'b0}} : roots[K];
      wire [BITS+3:0] next = {rest, number[2*BITS-1-:2]};
      wire [BITS+3:0] less = next - {2'b0, so_far, 2'b01};
      wire fits = !less[BITS+3];
      always @(posedge clk)
        if (enable) begin
          numbers[k+1] <= {number[2*BITS-3:0], 2'b0};
          rests[k+1] <= fits ? less[BITS+1:0] : next[BITS+1:0];
          roots[k+1] <= {so_far[BITS-2:0], fits};
          sides[k+1] <= k == 0 ? side : sides[K];
        end
      wire unused = &{1'b0, less[BITS+2], so_far[BITS-1]};
    end
  endgenerate
  assign root = roots[BITS];
  assign side_out = sides[BITS];
  wire unused = &{1'b0, numbers[BITS], rests[BITS]};
endmodule
