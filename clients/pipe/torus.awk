# A torus: stellate mesh --oracle-command "mawk -W interactive -f torus.awk" -e 0.1 -o torus.obj
# (gawk and busybox awk need no option.)
BEGIN {
  row = "%.17g %.17g %.17g %.17g %.17g %.17g %.17g 0 %.17g\n"
  print "stellate-oracle 1 text k=2 d=3 tangents=1 box=-1.5,-1.5,-0.5:1.5,1.5,0.5"
  fflush()
}
$1 == "closest" { left = $2; next }
{
  rho = sqrt($1 ^ 2 + $2 ^ 2)
  q = sqrt((rho - 1) ^ 2 + $3 ^ 2)
  if (rho * q == 0) {
    rows = rows "-\n"
  } else {
    c = $1 / rho; s = $2 / rho; o = (rho - 1) / q; u = $3 / q
    rows = rows sprintf(row, (1 + 0.4 * o) * c, (1 + 0.4 * o) * s, 0.4 * u, -s, -u * c, c, -u * s, o)
  }
}
# Many rows at once: with that option mawk writes whatever it is told to write at once.
--left % 50 == 0 { printf "%s", rows; rows = "" }
left == 0 { fflush() }
