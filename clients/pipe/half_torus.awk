# Half of a torus, where x >= 0:
# stellate mesh --oracle-command "mawk -W interactive -f half_torus.awk" -e 0.1 -o half.msh
BEGIN {
  row = "%.17g %.17g %.17g %.17g %.17g %.17g %.17g 0 %.17g %.17g%s\n"
  print "stellate-oracle 1 text k=2 d=3 tangents=1 walls=1 box=-1.5,-1.5,-0.5:1.5,1.5,0.5"
  fflush()
}
$1 == "closest" || $1 == "face" { left = $2; on_face = $1 == "face"; next }
{
  x = on_face ? 0 : $1  # points of the face have that
  rho = sqrt(x ^ 2 + $2 ^ 2)
  q = sqrt((rho - 1) ^ 2 + $3 ^ 2)
  if (rho * q == 0) {
    rows = rows "-\n"
  } else {
    c = x / rho; s = $2 / rho; o = (rho - 1) / q; u = $3 / q; r = 1 + 0.4 * o
    rows = rows sprintf(row, r * c, r * s, 0.4 * u, -s, -u * c, c, -u * s, o, r * c,
                        on_face ? " -1 0 0" : "")  # the wall's value, and its conormal
  }
}
# Many rows at once: with that option mawk writes whatever it is told to write at once.
--left % 50 == 0 { printf "%s", rows; rows = "" }
left == 0 { fflush() }
