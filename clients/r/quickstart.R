# Meshes a torus through an oracle of its own, and writes torus.obj and torus.txt.
#
# Usage: Rscript quickstart.R [EPSILON] [OUTPUT_DIRECTORY]
library(stellate)

closest_point <- function(x) {
  ring <- sqrt(x[, 1]^2 + x[, 2]^2)
  tube <- sqrt((ring - 1)^2 + x[, 3]^2)
  scale <- (1 + 0.4 * (ring - 1) / tube) / ring
  cbind(x[, 1] * scale, x[, 2] * scale, 0.4 * x[, 3] / tube)
}

arguments <- commandArgs(trailingOnly = TRUE)
epsilon <- if (length(arguments) > 0) as.numeric(arguments[1]) else 0.1
folder <- if (length(arguments) > 1) arguments[2] else "."
torus <- mesh(closest_point, 2, 3, epsilon, list(c(-1.5, -1.5, -0.5), c(1.5, 1.5, 0.5)))
print(torus)
torus$python$save(file.path(folder, "torus.obj"))
torus$python$save(file.path(folder, "torus.txt"))
quit(status = if (torus$certified) 0 else 1)
