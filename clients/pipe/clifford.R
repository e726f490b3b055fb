# The Clifford torus: stellate mesh --oracle-command "Rscript clifford.R" -e 0.2 -o clifford.txt
input <- file("stdin", "rb")
output <- file("/dev/stdout", "wb")
writeBin(charToRaw("stellate-oracle 1 binary k=2 d=4 tangents=1 box=-1,-1,-1,-1:1,1,1,1\n"), output)
flush(output)
while (length(head <- readBin(input, "integer", 4)) == 4) {
  n <- head[2]
  x <- matrix(readBin(input, "double", 4 * n), nrow = 4)
  a <- sqrt(x[1, ]^2 + x[2, ]^2)
  b <- sqrt(x[3, ]^2 + x[4, ]^2)
  x <- x / rbind(a, a, b, b)
  tangents <- rbind(-x[2, ], 0, x[1, ], 0, 0, -x[4, ], 0, x[3, ])
  writeBin(c(n, 5L), output)
  writeBin(as.vector(sqrt(0.5) * x), output)
  writeBin(as.vector(tangents), output)
  writeBin(as.raw(a * b > 0), output)
  flush(output)
}
