% A torus: stellate mesh --oracle-command "octave-cli -q torus.m" -e 0.1 -o torus.obj
puts("stellate-oracle 1 binary k=2 d=3 tangents=1 box=-1.5,-1.5,-0.5:1.5,1.5,0.5\n");
fflush(stdout);
while numel(head = fread(stdin, 4, "uint32")) == 4
  n = head(2);
  x = fread(stdin, [3 n], "double");  % a point a column
  rho = hypot(x(1,:), x(2,:));
  q = hypot(rho - 1, x(3,:));
  c = x(1,:) ./ rho;  s = x(2,:) ./ rho;  o = (rho - 1) ./ q;  u = x(3,:) ./ q;
  y = [(1 + 0.4*o) .* c; (1 + 0.4*o) .* s; 0.4*u];
  tangents = [-s; -u.*c; c; -u.*s; 0*s; o];  % row by row of a 3 x 2 matrix
  fwrite(stdout, [n 5], "uint32");           % 1 + 4: with tangents, and with found
  fwrite(stdout, y, "double");
  fwrite(stdout, tangents, "double");
  fwrite(stdout, rho .* q > 0, "uint8");
  fflush(stdout);
end
