% The Clifford torus: stellate mesh --oracle-command "octave-cli -q clifford.m" -e 0.2 -o clifford.txt
puts("stellate-oracle 1 binary k=2 d=4 tangents=1 box=-1,-1,-1,-1:1,1,1,1\n");
fflush(stdout);
while numel(head = fread(stdin, 4, "uint32")) == 4
  n = head(2);
  x = fread(stdin, [4 n], "double");
  a = hypot(x(1,:), x(2,:));
  b = hypot(x(3,:), x(4,:));
  x = x ./ [a; a; b; b];
  zero = zeros(1, n);
  tangents = [-x(2,:); zero; x(1,:); zero; zero; -x(4,:); zero; x(3,:)];
  fwrite(stdout, [n 5], "uint32");
  fwrite(stdout, sqrt(0.5) * x, "double");
  fwrite(stdout, tangents, "double");
  fwrite(stdout, a .* b > 0, "uint8");
  fflush(stdout);
end
