// A number of 60 bits without its leading zeros, six cycles later: its 27 leading bits, and how many zeros went so_far them (63 at most).
// Of 0 the leading bit is 0.
module normalize60 (
    input wire clk,
    input wire enable,
    input wire [59:0] value,
    output wire [26:0] front,
    output wire [5:0] zeros
);
  reg [59:0] shifted[0:5];
  reg [5:0] counted[0:5];
  genvar i;
  generate
    for (i = 0; i < 6; i = i + 1) begin : by
      localparam SHIFT = 32 >> i;
      wire [59:0] from = i == 0 ? value : shifted[i == 0 ? 0 : i - 1];
      wire [5:0] so_far = i == 0 ? 6'd0 : counted[i == 0 ? 0 : i - 1];
      wire empty = from[59-:SHIFT] == 0;
      always @(posedge clk)
        if (enable) begin
          shifted[i] <= empty ? from << SHIFT : from;
          counted[i] <= so_far + (empty ? SHIFT[5:0] : 6'd0);
        end
    end
  endgenerate
  assign front = shifted[5][59:33];
  assign zeros = counted[5];
  wire unused = &{1'b0, shifted[5][32:0]};
endmodule
