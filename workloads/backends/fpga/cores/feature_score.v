// feature_score: twice the smaller eigenvalue of the structure tensor of each pixel, in 1/64, 32 bits without sign, a pixel a cycle.
//
// Sobel gradients, their products summed over 3x3, all borders reflect-101: xx + yy - sqrt((xx - yy)^2 + (2 xy)^2), where the root is cut
// off after 6 bits behind the point; exactly 0 on a straight edge. What is done with the scores is the host's.
module feature_score (
    input wire clk,
    input wire reset,
    input wire [11:0] width,
    input wire [11:0] height,
    input wire in_valid,
    output wire in_ready,
    input wire [7:0] in_data,
    output wire out_valid,
    input wire out_ready,
    output wire [31:0] out_data
);
  wire gradient_valid, gradient_ready;
  wire [31:0] gradient;
  sobel #(.MAX_WIDTH(640), .ADDRESS(10)) gradients (
      .clk(clk), .reset(reset), .width(width), .height(height),
      .in_valid(in_valid), .in_ready(in_ready), .in_data(in_data),
      .out_valid(gradient_valid), .out_ready(gradient_ready), .out_data(gradient));

  reg products_valid;
  wire products_ready;
  assign gradient_ready = !products_valid || products_ready;
  wire signed [10:0] gx = gradient[10:0], gy = gradient[26:16];
  reg signed [21:0] xx, xy, yy;
  always @(posedge clk) begin
    if (gradient_ready) begin
      xx <= gx * gx;
      xy <= gx * gy;
      yy <= gy * gy;
    end
    if (reset) products_valid <= 0;
    else if (gradient_ready) products_valid <= gradient_valid;
  end

  wire taps_valid, enable;
  wire [593:0] taps;
  window #(.BITS(66), .R(1), .MAX_WIDTH(640), .ADDRESS(10)) around (
      .clk(clk), .reset(reset), .width(width), .height(height),
      .in_valid(products_valid), .in_ready(products_ready), .in_data({yy, xy, xx}),
      .out_valid(taps_valid), .out_ready(enable), .out_data(taps));

  // 1, 2: sums of three and of nine. 3: sum, difference. 4: squares. 5: what the root is taken of. Then 31 bits of it, and one difference.
  localparam ROOT = 31;
  localparam STAGES = 5 + ROOT + 1;
  reg [STAGES-1:0] valid;
  assign enable = !valid[STAGES-1] || out_ready;
  assign out_valid = valid[STAGES-1];
  always @(posedge clk)
    if (reset) valid <= 0;
    else if (enable) valid <= {valid[STAGES-2:0], taps_valid};
  wire [24:0] sum[0:2];
  genvar i, j;
  generate
    for (i = 0; i < 3; i = i + 1) begin : sums
      wire [24:0] three[0:2];
      reg [24:0] all;
      for (j = 0; j < 3; j = j + 1) begin : of_row
        localparam AT = j * 198 + i * 22;
        reg [24:0] r;
        always @(posedge clk)
          if (enable)
            r <= {{3{taps[AT+21]}}, taps[AT+:22]} + {{3{taps[AT+87]}}, taps[AT+66+:22]} + {{3{taps[AT+153]}}, taps[AT+132+:22]};
        assign three[j] = r;
      end
      always @(posedge clk) if (enable) all <= three[0] + three[1] + three[2];
      assign sum[i] = all;
    end
  endgenerate
  reg [24:0] both_3, both_4, both_5;
  reg signed [25:0] less_3, twice_3;
  reg signed [51:0] less_4, twice_4;
  reg [49:0] square_5;
  always @(posedge clk)
    if (enable) begin
      both_3 <= sum[0] + sum[2];
      less_3 <= {1'b0, sum[0]} - {1'b0, sum[2]};
      twice_3 <= {sum[1], 1'b0};
      both_4 <= both_3;
      less_4 <= less_3 * less_3;
      twice_4 <= twice_3 * twice_3;
      both_5 <= both_4;
      square_5 <= less_4[49:0] + twice_4[49:0];
    end
  wire [30:0] root;
  wire [24:0] both;
  square_root #(.BITS(ROOT), .SIDE(25)) rooting (
      .clk(clk), .enable(enable), .of({square_5, 12'b0}), .side(both_5), .root(root), .side_out(both));
  reg [31:0] score;
  assign out_data = score;
  always @(posedge clk) if (enable) score <= {1'b0, both, 6'b0} - {1'b0, root};
  wire unused = &{1'b0, gradient, less_4[51:50], twice_4[51:50]};
endmodule
