// sobel: gx (low half) and gy (high half), 16 bits each, border reflect-101. A pixel of 8 bits a cycle.
module sobel #(
    parameter MAX_WIDTH = 1920,
    parameter ADDRESS = 11
) (
    input wire clk,
    input wire reset,
    input wire [11:0] width,
    input wire [11:0] height,
    input wire in_valid,
    output wire in_ready,
    input wire [7:0] in_data,
    output reg out_valid,
    input wire out_ready,
    output wire [31:0] out_data
);
  wire enable = !out_valid || out_ready;
  wire taps_valid;
  wire [71:0] taps;
  window #(.BITS(8), .R(1), .MAX_WIDTH(MAX_WIDTH), .ADDRESS(ADDRESS)) around (
      .clk(clk), .reset(reset), .width(width), .height(height),
      .in_valid(in_valid), .in_ready(in_ready), .in_data(in_data),
      .out_valid(taps_valid), .out_ready(enable), .out_data(taps));

  // 1 2 1 of each outer row and column, then their differences.
  wire [7:0] nw = taps[7:0], n = taps[15:8], ne = taps[23:16], w = taps[31:24];
  wire [7:0] e = taps[47:40], sw = taps[55:48], s = taps[63:56], se = taps[71:64];
  reg [10:0] west, east, north, south, gx, gy;
  reg valid_1;
  assign out_data = {{5{gy[10]}}, gy, {5{gx[10]}}, gx};
  always @(posedge clk) begin
    if (enable) begin
      west <= {3'b0, nw} + {2'b0, w, 1'b0} + {3'b0, sw};
      east <= {3'b0, ne} + {2'b0, e, 1'b0} + {3'b0, se};
      north <= {3'b0, nw} + {2'b0, n, 1'b0} + {3'b0, ne};
      south <= {3'b0, sw} + {2'b0, s, 1'b0} + {3'b0, se};
      gx <= east - west;
      gy <= south - north;
    end
    if (reset) {out_valid, valid_1} <= 0;
    else if (enable) {out_valid, valid_1} <= {valid_1, taps_valid};
  end
  wire unused = &{1'b0, taps[39:32]};
endmodule
