#!/bin/sh
# A torus: stellate mesh --oracle-command "sh torus.sh" -e 0.2 -o torus.obj
echo "stellate-oracle 1 text k=2 d=3 tangents=1 box=-1.5,-1.5,-0.5:1.5,1.5,0.5"
program='
scale = 25
define void t(x, y, z) {
  auto h, q, c, s, o, u
  h = sqrt(x^2 + y^2)
  q = sqrt((h - 1)^2 + z^2)
  if (h * q == 0) { print "-\n"; return }
  c = x/h; s = y/h; o = (h - 1)/q; u = z/q
  print (1 + 0.4*o)*c, " ", (1 + 0.4*o)*s, " ", 0.4*u, " "
  print -s, " ", -u*c, " ", c, " ", -u*s, " ", 0, " ", o, "\n"
}'
while read -r _ n _; do
  {
    echo "$program"
    while [ "$n" -gt 0 ] && read -r x y z; do
      echo "t($x, $y, $z)"
      n=$((n - 1))
    done
  } | BC_LINE_LENGTH=0 bc
done
