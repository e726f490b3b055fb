# The Clifford torus:
#   stellate mesh --oracle-command "mawk -W interactive -f clifford.awk" -e 0.2 -o clifford.txt
BEGIN {
  row = "%.17g %.17g %.17g %.17g %.17g 0 %.17g 0 0 %.17g 0 %.17g\n"
  print "stellate-oracle 1 text k=2 d=4 tangents=1 box=-1,-1,-1,-1:1,1,1,1"
  fflush()
}
$1 == "closest" { left = $2; next }
{
  a = sqrt($1 ^ 2 + $2 ^ 2)
  b = sqrt($3 ^ 2 + $4 ^ 2)
  if (a * b == 0) {
    rows = rows "-\n"
  } else {
    x = $1 / a; y = $2 / a; z = $3 / b; w = $4 / b; h = sqrt(0.5)
    rows = rows sprintf(row, h * x, h * y, h * z, h * w, -y, x, -w, z)
  }
}
# Many rows at once: with that option mawk writes whatever it is told to write at once.
--left % 50 == 0 { printf "%s", rows; rows = "" }
left == 0 { fflush() }
