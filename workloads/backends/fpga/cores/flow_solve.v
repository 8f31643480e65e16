// From the five sums xx, xy, yy, xt, yt of a window to the flow u, v as f32: with det = xx yy - xy xy,
// u = 2 (xy yt - yy xt) / det and v = 2 (xy xt - xx yt) / det; 0 where det is 0.
module flow_solve (
    input wire clk,
    input wire reset,
    input wire in_valid,
    output wire in_ready,
    input wire [149:0] in_data,  // five of 30 bits
    output wire out_valid,
    input wire out_ready,
    output wire [63:0] out_data
);
  localparam STEPS = 25;                       // bits of a quotient
  localparam STAGES = 4 + 2 + 6 + 1 + STEPS + 1;
  reg [STAGES-1:0] valid;
  wire enable = !valid[STAGES-1] || out_ready;
  assign in_ready = enable;
  assign out_valid = valid[STAGES-1];
  always @(posedge clk)
    if (reset) valid <= 0;
    else if (enable) valid <= {valid[STAGES-2:0], in_valid};

  // 1 to 3: six products. 4: three differences.
  wire [29:0] xx = in_data[29:0], xy = in_data[59:30], yy = in_data[89:60];
  wire [29:0] xt = in_data[119:90], yt = in_data[149:120];
  wire [59:0] xx_yy, xy_xy, xy_yt, yy_xt, xy_xt, xx_yt;
  multiply30 m0 (.clk(clk), .enable(enable), .a(xx), .b(yy), .product(xx_yy));
  multiply30 m1 (.clk(clk), .enable(enable), .a(xy), .b(xy), .product(xy_xy));
  multiply30 m2 (.clk(clk), .enable(enable), .a(xy), .b(yt), .product(xy_yt));
  multiply30 m3 (.clk(clk), .enable(enable), .a(yy), .b(xt), .product(yy_xt));
  multiply30 m4 (.clk(clk), .enable(enable), .a(xy), .b(xt), .product(xy_xt));
  multiply30 m5 (.clk(clk), .enable(enable), .a(xx), .b(yt), .product(xx_yt));
  reg [59:0] det_4, u_4, v_4;
  always @(posedge clk)
    if (enable) begin
      det_4 <= xx_yy - xy_xy;
      u_4 <= xy_yt - yy_xt;
      v_4 <= xy_xt - xx_yt;
    end

  // 5: signs apart. 6: complete. 7 to 12: the leading bit of each to the front.
  reg [59:0] det_5, u_5, v_5, det_6, u_6, v_6;
  reg [1:0] signs_5, signs_6;  // v, u
  always @(posedge clk)
    if (enable) begin
      det_5 <= det_4;
      u_5 <= u_4 ^ {60{u_4[59]}};
      v_5 <= v_4 ^ {60{v_4[59]}};
      signs_5 <= {v_4[59], u_4[59]};
      det_6 <= det_5;
      u_6 <= u_5 + {59'b0, signs_5[0]};
      v_6 <= v_5 + {59'b0, signs_5[1]};
      signs_6 <= signs_5;
    end
  wire [26:0] det_front, u_front, v_front;
  wire [5:0] det_zeros, u_zeros, v_zeros;
  normalize60 n0 (.clk(clk), .enable(enable), .value(det_6), .front(det_front), .zeros(det_zeros));
  normalize60 n1 (.clk(clk), .enable(enable), .value(u_6), .front(u_front), .zeros(u_zeros));
  normalize60 n2 (.clk(clk), .enable(enable), .value(v_6), .front(v_front), .zeros(v_zeros));
  reg [1:0] signs[7:12];
  always @(posedge clk) if (enable) signs[7] <= signs_6;
  genvar i;
  generate
    for (i = 8; i <= 12; i = i + 1) begin : carried
      always @(posedge clk) if (enable) signs[i] <= signs[i-1];
    end
  endgenerate

  // 13: exponents of the factors; 2^0 is 127, the factor 2 of the numerators is one more.
  reg [1:0] sign_13, zero_13;
  reg [7:0] u_exponent_13, v_exponent_13;
  reg [26:0] det_13, u_13, v_13;
  always @(posedge clk)
    if (enable) begin
      sign_13 <= signs[12];
      zero_13 <= {!v_front[26] || !det_front[26], !u_front[26] || !det_front[26]};
      u_exponent_13 <= 8'd128 + {2'b0, det_zeros} - {2'b0, u_zeros};
      v_exponent_13 <= 8'd128 + {2'b0, det_zeros} - {2'b0, v_zeros};
      det_13 <= det_front;
      u_13 <= u_front;
      v_13 <= v_front;
    end

  // 14 to 38: a bit of both quotients a step.
  wire [19:0] side = {v_exponent_13, u_exponent_13, zero_13, sign_13};
  wire [19:0] side_q;
  wire [24:0] u_q, v_q;
  divide #(.STEPS(STEPS), .BITS(27), .SIDE(20)) quotients (
      .clk(clk), .enable(enable), .by(det_13), .a(u_13), .b(v_13), .side(side),
      .a_quotient(u_q), .b_quotient(v_q), .side_out(side_q));

  // 39: f32.
  reg [31:0] u, v;
  assign out_data = {v, u};
  wire [7:0] u_exponent = side_q[11:4] - {7'b0, !u_q[24]}, v_exponent = side_q[19:12] - {7'b0, !v_q[24]};
  always @(posedge clk)
    if (enable) begin
      u <= side_q[2] ? 32'd0 : {side_q[0], u_exponent, u_q[24] ? u_q[23:1] : u_q[22:0]};
      v <= side_q[3] ? 32'd0 : {side_q[1], v_exponent, v_q[24] ? v_q[23:1] : v_q[22:0]};
    end
endmodule
