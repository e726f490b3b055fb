# The Clifford torus:
#   stellate mesh --oracle-command "mawk -W interactive -f clifford.awk" -e 0.2 -o clifford.txt
BEGIN {
  OFMT = CONVFMT = "%.17g"
  print "stellate-oracle 1 text k=2 d=4 tangents=1 box=-1,-1,-1,-1:1,1,1,1"
  fflush()
}
$1 == "closest" { left = $2; next }
{
  a = sqrt($1 ^ 2 + $2 ^ 2)
  b = sqrt($3 ^ 2 + $4 ^ 2)
  if (a * b == 0) {
    print "-"
  } else {
    x = $1 / a; y = $2 / a; z = $3 / b; w = $4 / b; h = sqrt(0.5)
    print h * x, h * y, h * z, h * w, -y, 0, x, 0, 0, -w, 0, z
  }
  if (--left == 0) fflush()
}
