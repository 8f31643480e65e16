// Where pixels beyond a picture's border come from; included by who needs it.

/// Border reflect-101: -1 -> 1, n -> n-2. Loops: what reaches beyond a small picture is reflected
/// more than once.
int reflect(int i, int n) {
  if (n == 1) return 0;
  while (i < 0 || i >= n) i = i < 0 ? -i : 2 * n - 2 - i;
  return i;
}
