# A torus: stellate mesh --oracle-command "perl torus.pl" -e 0.1 -o torus.obj
use strict;
binmode STDIN;
binmode STDOUT;
$| = 1;
print "stellate-oracle 1 binary k=2 d=3 tangents=1 box=-1.5,-1.5,-0.5:1.5,1.5,0.5\n";
while (read(STDIN, my $head, 16) == 16) {
  my (undef, $n) = unpack "L4", $head;
  read STDIN, my $bytes, 24 * $n;
  my ($points, $tangents, $found) = ("", "", "");
  for my $i (0 .. $n - 1) {
    my ($x, $y, $z) = unpack "d3", substr $bytes, 24 * $i, 24;
    my $rho = sqrt($x**2 + $y**2);
    my $q = sqrt(($rho - 1)**2 + $z**2);
    $found .= pack "C", $rho * $q > 0;
    ($rho, $q) = (1, 1) if $rho * $q == 0;
    my ($c, $s, $o, $u) = ($x / $rho, $y / $rho, ($rho - 1) / $q, $z / $q);
    $points .= pack "d3", (1 + 0.4 * $o) * $c, (1 + 0.4 * $o) * $s, 0.4 * $u;
    $tangents .= pack "d6", -$s, -$u * $c, $c, -$u * $s, 0, $o;  # row by row of a 3 x 2 matrix
  }
  print pack("L2", $n, 5), $points, $tangents, $found;  # 1 + 4: with tangents, and with found
}
