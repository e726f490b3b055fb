# Half of a torus, where x >= 0: stellate mesh --oracle-command "perl half_torus.pl" -e 0.1 -o half.msh
use strict;
binmode STDIN;
binmode STDOUT;
$| = 1;
print "stellate-oracle 1 binary k=2 d=3 tangents=1 walls=1 box=-1.5,-1.5,-0.5:1.5,1.5,0.5\n";
while (read(STDIN, my $head, 16) == 16) {
  my ($kind, $n, undef, $on) = unpack "L4", $head;
  read STDIN, my $walls, 4 * $on;  # of the face: there is one
  read STDIN, my $bytes, 24 * $n;
  my ($points, $tangents, $clearances, $conormals, $found) = ("") x 5;
  for my $i (0 .. $n - 1) {
    my ($x, $y, $z) = unpack "d3", substr $bytes, 24 * $i, 24;
    $x = 0 if $kind == 3;  # points of the face have that
    my $rho = sqrt($x**2 + $y**2);
    my $q = sqrt(($rho - 1)**2 + $z**2);
    $found .= pack "C", $rho * $q > 0;
    ($rho, $q) = (1, 1) if $rho * $q == 0;
    my ($c, $s, $o, $u) = ($x / $rho, $y / $rho, ($rho - 1) / $q, $z / $q);
    $points .= pack "d3", (1 + 0.4 * $o) * $c, (1 + 0.4 * $o) * $s, 0.4 * $u;
    $tangents .= pack "d6", -$s, -$u * $c, $c, -$u * $s, 0, $o;  # row by row of a 3 x 2 matrix
    $clearances .= pack "d", (1 + 0.4 * $o) * $c;
    $conormals .= pack "d3", -1, 0, 0 if $kind == 3;
  }
  print pack("L2", $n, 21), $points, $tangents, $clearances, $conormals, $found;  # 1 + 4 + 16: walls
}
