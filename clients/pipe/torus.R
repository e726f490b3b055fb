# A torus: stellate mesh --oracle-command "Rscript torus.R" -e 0.1 -o torus.obj
input <- file("stdin", "rb")
output <- file("/dev/stdout", "wb")  # stdout() takes text alone
writeBin(charToRaw("stellate-oracle 1 binary k=2 d=3 tangents=1 box=-1.5,-1.5,-0.5:1.5,1.5,0.5\n"), output)
flush(output)
while (length(head <- readBin(input, "integer", 4)) == 4) {
  n <- head[2]
  x <- matrix(readBin(input, "double", 3 * n), nrow = 3)  # a point a column
  rho <- sqrt(x[1, ]^2 + x[2, ]^2)
  q <- sqrt((rho - 1)^2 + x[3, ]^2)
  c <- x[1, ] / rho; s <- x[2, ] / rho; o <- (rho - 1) / q; u <- x[3, ] / q
  y <- rbind((1 + 0.4 * o) * c, (1 + 0.4 * o) * s, 0.4 * u)
  tangents <- rbind(-s, -u * c, c, -u * s, 0, o)  # row by row of a 3 x 2 matrix
  writeBin(c(n, 5L), output)                      # 1 + 4: with tangents, and with found
  writeBin(as.vector(y), output)
  writeBin(as.vector(tangents), output)
  writeBin(as.raw(rho * q > 0), output)
  flush(output)
}
