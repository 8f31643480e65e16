// convolution: 49 weights of 8 bits, sum / 256 with halves to the even neighbour, saturated, border reflect-101. A pixel of 8 bits a cycle.
// The weights are set before the first pixel, row by row.
module convolution (
    input wire clk,
    input wire reset,
    input wire [11:0] width,
    input wire [11:0] height,
    input wire set_valid,
    input wire [7:0] set_data,
    input wire in_valid,
    output wire in_ready,
    input wire [7:0] in_data,
    output reg out_valid,
    input wire out_ready,
    output reg [7:0] out_data
);
  wire enable = !out_valid || out_ready;
  wire taps_valid;
  wire [391:0] taps;
  window #(.BITS(8), .R(3), .MAX_WIDTH(640), .ADDRESS(10)) around (
      .clk(clk), .reset(reset), .width(width), .height(height),
      .in_valid(in_valid), .in_ready(in_ready), .in_data(in_data),
      .out_valid(taps_valid), .out_ready(enable), .out_data(taps));

  reg [391:0] weights;
  always @(posedge clk) if (set_valid) weights <= {set_data, weights[391:8]};

  // 1: products. 2 to 4: their sums by fours.
  wire [16:0] product[0:51];
  wire [18:0] quarter[0:15];
  wire [20:0] sixteenth[0:3];
  genvar i;
  generate
    for (i = 0; i < 52; i = i + 1) begin : products
      if (i < 49) begin : real_one
        wire signed [8:0] weight = {weights[i*8+7], weights[i*8+:8]};
        wire signed [8:0] tap = {1'b0, taps[i*8+:8]};
        wire signed [17:0] both = weight * tap;
        reg [16:0] r;
        always @(posedge clk) if (enable) r <= both[16:0];
        assign product[i] = r;
        wire unused = &{1'b0, both[17]};  // |product| is at most 128 * 255
      end else begin : none
        assign product[i] = 0;
      end
    end
    for (i = 0; i < 16; i = i + 1) begin : quarters
      if (i < 13) begin : real_one
        reg [18:0] r;
        wire [18:0] a = {{2{product[4*i][16]}}, product[4*i]}, b = {{2{product[4*i+1][16]}}, product[4*i+1]};
        wire [18:0] c = {{2{product[4*i+2][16]}}, product[4*i+2]}, d = {{2{product[4*i+3][16]}}, product[4*i+3]};
        always @(posedge clk) if (enable) r <= (a + b) + (c + d);
        assign quarter[i] = r;
      end else begin : none
        assign quarter[i] = 0;
      end
    end
    for (i = 0; i < 4; i = i + 1) begin : sixteenths
      reg [20:0] r;
      wire [20:0] a = {{2{quarter[4*i][18]}}, quarter[4*i]}, b = {{2{quarter[4*i+1][18]}}, quarter[4*i+1]};
      wire [20:0] c = {{2{quarter[4*i+2][18]}}, quarter[4*i+2]}, d = {{2{quarter[4*i+3][18]}}, quarter[4*i+3]};
      always @(posedge clk) if (enable) r <= (a + b) + (c + d);
      assign sixteenth[i] = r;
    end
  endgenerate
  reg [22:0] sum;
  wire [22:0] a = {{2{sixteenth[0][20]}}, sixteenth[0]}, b = {{2{sixteenth[1][20]}}, sixteenth[1]};
  wire [22:0] c = {{2{sixteenth[2][20]}}, sixteenth[2]}, d = {{2{sixteenth[3][20]}}, sixteenth[3]};

  // 5: rounded. 6: saturated.
  reg [14:0] rounded;
  wire up = sum[7] && (sum[6:0] != 0 || sum[8]);
  reg [4:0] valid;
  always @(posedge clk) begin
    if (enable) begin
      sum <= (a + b) + (c + d);
      rounded <= sum[22:8] + {14'b0, up};
      out_data <= rounded[14] ? 8'd0 : rounded[13:8] != 0 ? 8'd255 : rounded[7:0];
    end
    if (reset) {out_valid, valid} <= 0;
    else if (enable) {out_valid, valid} <= {valid, taps_valid};
  end
endmodule
