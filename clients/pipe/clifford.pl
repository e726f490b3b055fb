# The Clifford torus: stellate mesh --oracle-command "perl clifford.pl" -e 0.2 -o clifford.txt
use strict;
binmode STDIN;
binmode STDOUT;
$| = 1;
print "stellate-oracle 1 binary k=2 d=4 tangents=1 box=-1,-1,-1,-1:1,1,1,1\n";
while (read(STDIN, my $head, 16) == 16) {
  my (undef, $n) = unpack "L4", $head;
  read STDIN, my $bytes, 32 * $n;
  my ($points, $tangents, $found) = ("", "", "");
  for my $i (0 .. $n - 1) {
    my ($x, $y, $z, $w) = unpack "d4", substr $bytes, 32 * $i, 32;
    my ($a, $b) = (sqrt($x**2 + $y**2), sqrt($z**2 + $w**2));
    $found .= pack "C", $a * $b > 0;
    ($a, $b) = (1, 1) if $a * $b == 0;
    ($x, $y, $z, $w) = ($x / $a, $y / $a, $z / $b, $w / $b);
    $points .= pack "d4", map { sqrt(0.5) * $_ } $x, $y, $z, $w;
    $tangents .= pack "d8", -$y, 0, $x, 0, 0, -$w, 0, $z;
  }
  print pack("L2", $n, 5), $points, $tangents, $found;
}
