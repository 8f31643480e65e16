// Taps along one direction, the middle one `ahead` places from the line's first and `behind` from its last: those beyond it are replaced,
// mirrored without the edge (reflect-101) or by the edge itself (REPLICATE).
module border #(
    parameter BITS = 8,
    parameter R = 1,
    parameter REPLICATE = 0
) (
    input wire [(2*R+1)*BITS-1:0] taps,
    input wire [11:0] ahead,
    input wire [11:0] behind,
    output wire [(2*R+1)*BITS-1:0] mirrored
);
  genvar d;
  assign mirrored[R*BITS+:BITS] = taps[R*BITS+:BITS];
  generate
    for (d = 1; d <= R; d = d + 1) begin : at_distance
      // With the edge k places from the middle, what stands d places away lies d - 2k on the other side of it.
      reg [BITS-1:0] low, high;
      integer k;
      always @* begin
        low = taps[(R-d)*BITS+:BITS];
        high = taps[(R+d)*BITS+:BITS];
        for (k = 0; k < d; k = k + 1) begin
          if (ahead == k[11:0]) low = taps[(REPLICATE != 0 ? R - k : R + d - 2 * k)*BITS+:BITS];
          if (behind == k[11:0]) high = taps[(REPLICATE != 0 ? R + k : R - d + 2 * k)*BITS+:BITS];
        end
      end
      assign mirrored[(R-d)*BITS+:BITS] = low;
      assign mirrored[(R+d)*BITS+:BITS] = high;
    end
  endgenerate
endmodule
