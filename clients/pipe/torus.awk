# A torus: stellate mesh --oracle-command "mawk -W interactive -f torus.awk" -e 0.1 -o torus.obj
# (gawk and busybox awk need no option.)
BEGIN {
  OFMT = CONVFMT = "%.17g"
  print "stellate-oracle 1 text k=2 d=3 tangents=1 box=-1.5,-1.5,-0.5:1.5,1.5,0.5"
  fflush()
}
$1 == "closest" { left = $2; next }
{
  rho = sqrt($1 ^ 2 + $2 ^ 2)
  q = sqrt((rho - 1) ^ 2 + $3 ^ 2)
  if (rho * q == 0) {
    print "-"
  } else {
    c = $1 / rho; s = $2 / rho; o = (rho - 1) / q; u = $3 / q
    print (1 + 0.4 * o) * c, (1 + 0.4 * o) * s, 0.4 * u, -s, -u * c, c, -u * s, 0, o
  }
  if (--left == 0) fflush()
}
