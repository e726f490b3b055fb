# Obeys `stellate conform`, whose help says what each line wants: as a worker, the one thing that R
# does by itself.
library(stellate)

address <- commandArgs(trailingOnly = TRUE)[1]
norm <- function(x) sqrt(rowSums(x^2))

torus <- function(x) {
  ring <- norm(x[, 1:2, drop = FALSE])
  tube <- sqrt((ring - 1)^2 + x[, 3]^2)
  scale <- (1 + 0.4 * (ring - 1) / tube) / ring
  cbind(x[, 1] * scale, x[, 2] * scale, 0.4 * x[, 3] / tube)
}
torus_basis <- function(p) {
  ring <- norm(p[, 1:2, drop = FALSE])
  cosine <- p[, 1] / ring
  sine <- p[, 2] / ring
  out <- (ring - 1) / 0.4
  up <- p[, 3] / 0.4
  array(c(-sine, cosine, 0 * ring, -cosine * up, -sine * up, out), c(nrow(p), 3, 2))
}
like_torus <- function(closest_point) {
  list(closest_point = closest_point, tangent_basis = torus_basis)
}

clifford <- list(
  closest_point = function(x) {
    first <- norm(x[, 1:2, drop = FALSE])
    second <- norm(x[, 3:4, drop = FALSE])
    x / cbind(first, first, second, second)
  },
  tangent_basis = function(p) {
    zero <- 0 * p[, 1]
    array(c(-p[, 2], p[, 1], zero, zero, zero, zero, -p[, 4], p[, 3]), c(nrow(p), 4, 2))
  }
)

circle <- list(
  closest_point = function(x) {
    x[, -(1:2)] <- 0
    x / norm(x)
  },
  tangent_basis = function(p) {
    bases <- array(0, c(dim(p), 1))
    bases[, 1, 1] <- -p[, 2]
    bases[, 2, 1] <- p[, 1]
    bases
  }
)

sphere <- list(
  closest_point = function(x) x / norm(x),
  tangent_basis = function(p) {
    s <- ifelse(p[, 3] < 0, -1, 1)
    a <- -1 / (s + p[, 3])
    b <- p[, 1] * p[, 2] * a
    first <- c(1 + s * p[, 1]^2 * a, s * b, -s * p[, 1])
    array(c(first, b, s + p[, 2]^2 * a, -p[, 2]), c(nrow(p), 3, 2))
  },
  local_size = function(p) 1 + p[, 3] / 2,
  intersect_flat = function(centers, bases, radii) {
    u <- matrix(bases[, , 1], ncol = 3)
    v <- matrix(bases[, , 2], ncol = 3)
    along <- cbind(
      u[, 2] * v[, 3] - u[, 3] * v[, 2], u[, 3] * v[, 1] - u[, 1] * v[, 3],
      u[, 1] * v[, 2] - u[, 2] * v[, 1]
    )
    middle <- rowSums(along * centers)
    root <- middle^2 - rowSums(centers^2) + 1
    step <- ifelse(middle < 0, -1, 1) * sqrt(pmax(root, 0)) - middle
    points <- centers + step * along
    points[root < 0 | abs(step) > radii, ] <- NA
    points
  }
)

# The part of the sphere where z and y are not negative, its two walls.
axes <- c(3, 2)
lune <- list(
  closest_point = sphere$closest_point, tangent_basis = sphere$tangent_basis, walls = 2,
  face_point = function(x, face) {
    x[, axes[face]] <- 0
    points <- sphere$closest_point(x)
    points[is.nan(points)] <- NA
    points
  },
  clearances = function(p) p[, axes, drop = FALSE],
  conormals = function(p, face) {
    normals <- array(0, c(nrow(p), length(face), 3))
    for (i in seq_along(face)) normals[, i, axes[face[i]]] <- -1
    normals
  }
)

oracles <- list(
  torus = like_torus(torus), clifford = clifford, sphere = sphere,
  lune = lune,
  half = like_torus(function(x) {
    points <- torus(x)
    points[x[, 1] < 0, ] <- NA
    points
  }),
  raises = like_torus(function(x) stop("on purpose")),
  slow = like_torus(function(x) {
    for (i in 1:40) reticulate::import("time")$sleep(0.05) # lets Python run meanwhile
    torus(x)
  })
)

serve_mesh <- function(mesh, name) {
  oracle <- if (startsWith(name, "circle:")) circle else oracles[[name]]
  if (is.null(oracle)) {
    return("unsupported")
  }
  tryCatch(
    paste("over", do.call(serve, c(list(name = mesh, server = address), oracle))),
    error = function(failure) {
      said <- gsub("\n", " ", conditionMessage(failure))
      kind <- regmatches(said, regexpr("stellate\\.errors\\.[A-Za-z]+", said))
      if (length(kind) == 0) {
        return(paste("error oracle RAISED", said))
      }
      paste("error", sub("stellate.errors.", "", kind, fixed = TRUE), "-", said)
    }
  )
}

input <- file("stdin", "r")
repeat {
  line <- readLines(input, n = 1)
  if (length(line) == 0) {
    break
  }
  words <- strsplit(line, " ")[[1]]
  cat(if (words[1] == "serve") serve_mesh(words[2], words[3]) else "unsupported", "\n", sep = "")
}
