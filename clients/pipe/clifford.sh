#!/bin/sh
# The Clifford torus: stellate mesh --oracle-command "sh clifford.sh" -e 0.3 -o clifford.txt
echo "stellate-oracle 1 text k=2 d=4 tangents=1 box=-1,-1,-1,-1:1,1,1,1"
program='
scale = 25
r = sqrt(0.5)
define void t(x, y, z, w) {
  auto a, b
  a = sqrt(x^2 + y^2)
  b = sqrt(z^2 + w^2)
  if (a * b == 0) { print "-\n"; return }
  x = x/a; y = y/a; z = z/b; w = w/b
  print r*x, " ", r*y, " ", r*z, " ", r*w, " "
  print -y, " ", 0, " ", x, " ", 0, " ", 0, " ", -w, " ", 0, " ", z, "\n"
}'
while read -r _ n _; do
  {
    echo "$program"
    while [ "$n" -gt 0 ] && read -r x y z w; do
      echo "t($x, $y, $z, $w)"
      n=$((n - 1))
    done
  } | BC_LINE_LENGTH=0 bc
done
