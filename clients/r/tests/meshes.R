# Against the real server; tests/languages/run says what is expected.
library(stellate)

counts <- as.integer(strsplit(trimws(Sys.getenv("STELLATE_TEST_COUNTS")), " ")[[1]])
stopifnot(length(counts) == 4)
python <- reticulate::import("stellate")
server <- python$Server()
address <- server$address

norm <- function(x) sqrt(rowSums(x^2))
box <- function(x) list(-x, x)

torus <- list(
  closest_point = function(x) {
    ring <- norm(x[, 1:2, drop = FALSE])
    tube <- sqrt((ring - 1)^2 + x[, 3]^2)
    scale <- (1 + 0.4 * (ring - 1) / tube) / ring
    answer <- cbind(x[, 1] * scale, x[, 2] * scale, 0.4 * x[, 3] / tube)
    answer[!is.finite(rowSums(answer)), ] <- NA
    answer
  },
  tangent_basis = function(p) {
    ring <- norm(p[, 1:2, drop = FALSE])
    cosine <- p[, 1] / ring
    sine <- p[, 2] / ring
    out <- (ring - 1) / 0.4
    up <- p[, 3] / 0.4
    array(c(-sine, cosine, 0 * ring, -cosine * up, -sine * up, out), c(nrow(p), 3, 2))
  }
)
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

# The same meshes as the Python client's, with progress on this thread.
phases <- character()
grown <- mesh(torus$closest_point, 2, 3, 0.1, box(c(1.54, 1.54, 0.44)),
  tangent_basis = torus$tangent_basis, server = address,
  on_progress = function(progress) phases <<- union(phases, progress$phase)
)
stopifnot(identical(c(nrow(grown$points), nrow(grown$simplices)), counts[1:2]))
stopifnot(grown$certified, range(grown$simplices) == c(1, counts[1]), "REFINING" %in% phases)
grown <- mesh(clifford$closest_point, 2, 4, 0.3, box(rep(1.1, 4)),
  tangent_basis = clifford$tangent_basis, server = address
)
stopifnot(identical(c(nrow(grown$points), nrow(grown$simplices)), counts[3:4]), grown$certified)

# What an oracle stops with comes back as itself; the server's refusals come with their words.
failure <- function(expression) tryCatch(expression, error = conditionMessage)
meshed <- function(oracle, epsilon = 0.1) {
  failure(mesh(oracle, 2, 3, epsilon, box(rep(1.5, 3)), server = address))
}
said <- meshed(function(x) stop("no such surface"))
stopifnot(identical(said, "no such surface"))
said <- meshed(torus$closest_point, -1)
stopifnot(grepl("epsilon", said), grepl("InvalidArgument", said))
said <- meshed(function(x) x[, 1:2, drop = FALSE])
stopifnot(grepl("3 columns", said))

# Manifolds with boundary: the half of the unit sphere above the plane z = 0.
half <- list(
  closest_point = function(x) x / norm(x),
  walls = 1,
  face_point = function(x, face) {
    stopifnot(identical(face, 1L))
    x[, 3] <- 0
    x / norm(x)
  },
  tangent_basis = function(p) {
    s <- ifelse(p[, 3] < 0, -1, 1)
    a <- -1 / (s + p[, 3])
    b <- p[, 1] * p[, 2] * a
    first <- c(1 + s * p[, 1]^2 * a, s * b, -s * p[, 1])
    array(c(first, b, s + p[, 2]^2 * a, -p[, 2]), c(nrow(p), 3, 2))
  },
  clearances = function(p) p[, 3],
  conormals = function(p, face) array(rep(c(0, 0, -1), each = nrow(p)), c(nrow(p), 1, 3))
)
with_oracle <- function(what, oracle, ...) do.call(what, c(oracle, list(...)))
unit_box <- box(rep(1.1, 3))
grown <- with_oracle(mesh, half,
  dimension = 2, ambient_dimension = 3, epsilon = 0.2, bounding_box = unit_box, server = address
)
expected <- as.integer(strsplit(trimws(Sys.getenv("STELLATE_TEST_HEMISPHERE")), " ")[[1]])
stopifnot(identical(c(nrow(grown$points), nrow(grown$simplices)), expected), grown$certified)
on <- grown$points[, 3] == 0
stopifnot(identical(dim(grown$walls), c(expected[1], 1L)), identical(as.vector(grown$walls), on))
circle <- boundary(grown)
stopifnot(length(circle) == 1, circle[[1]]$walls == 1, nrow(circle[[1]]$simplices) == sum(on))
stopifnot(setequal(circle[[1]]$simplices, which(on)))
said <- failure(mesh(half$closest_point, 2, 3, 0.2, unit_box, walls = 1, server = address))
stopifnot(grepl("tangent_basis and face_point and clearances and conormals", said))

# The doctor.
examined <- check(torus$closest_point, 2, 3, box(c(1.54, 1.54, 0.44)),
  tangent_basis = torus$tangent_basis
)
stopifnot(examined$ok, abs(examined$reach - 0.4) < 0.1, !"error" %in% examined$findings$severity)
stopifnot(any(grepl("keeps its contract", capture.output(print(examined)))))
examined <- with_oracle(check, half, dimension = 2, ambient_dimension = 3, bounding_box = unit_box)
stopifnot(examined$ok)
codes <- function(closest_point, ...) check(closest_point, 2, 3, unit_box, ...)$findings$code
stopifnot("NOT_IDEMPOTENT" %in% codes(function(x) (x + half$closest_point(x)) / 2))
stopifnot("RAISED" %in% codes(function(x) stop("no such surface")))
stopifnot("NOT_FINITE" %in% codes(function(x) x / 0))
inwards <- half
inwards$conormals <- function(p, face) -half$conormals(p, face)
found <- with_oracle(check, inwards, dimension = 2, ambient_dimension = 3, bounding_box = unit_box)
stopifnot("CONORMAL_INWARD" %in% found$findings$code, !found$ok)

# A quarter of the reach, for those who have no size in mind.
grown <- mesh(half$closest_point, 2, 3, "auto", unit_box, server = address)
stopifnot(grown$certified, abs(grown$python$report$epsilon - 0.25) < 0.05)
stopifnot(grepl("NOT_IDEMPOTENT", failure(
  mesh(function(x) (x + half$closest_point(x)) / 2, 2, 3, "auto", unit_box, server = address)
)))

# It goes on where that was too coarse: for a circle beside the unit circle, which the doctor
# hardly sees.
two_circles <- function(x) {
  y <- cbind(x[, 1] - 1.05, x[, 2])
  large <- abs(norm(x) - 1) <= abs(norm(y) - 0.005)
  beside <- 0.005 * y / norm(y)
  beside[, 1] <- beside[, 1] + 1.05
  ifelse(cbind(large, large), x / norm(x), beside)
}
grown <- mesh(two_circles, 1, 2, "auto", list(c(-1.1, -1.1), c(1.2, 1.1)),
  seeds = rbind(c(-1, 0), c(1.05, 0.005)), server = address
)
stopifnot(grown$certified, grepl("too coarse", grown$python$report$epsilon_reason))

# A checkpoint: an oracle stops in the middle, and the same call goes on from there.
folder <- tempfile("checkpoint")
asked <- 0
stopping <- function(limit) {
  function(x) {
    asked <<- asked + nrow(x)
    if (asked > limit) stop("the power is gone")
    half$closest_point(x)
  }
}
kept <- function(limit) {
  asked <<- 0
  failure(mesh(stopping(limit), 2, 3, 0.15, unit_box, checkpoint = folder))
}
stopifnot(identical(kept(1000), "the power is gone"))
whole <- kept(Inf)
stopifnot(whole$certified)
again <- kept(0) # it is finished, and asks nothing
stopifnot(asked == 0, identical(again$points, whole$points))
stopifnot(grepl("private server", failure(
  mesh(half$closest_point, 2, 3, 0.2, unit_box, checkpoint = folder, server = address)
)))

said <- meshed(function(x) x * NaN)
stopifnot(grepl("is NaN NaN NaN: a row of NA says that there is none", said, fixed = TRUE))

# A mesh of others.
client <- python$Client(address)
declared <- client$create(python$manifolds$Torus(), 0.1) # with tangents and sizes
state <- serve(torus$closest_point, declared$name, address,
  tangent_basis = torus$tangent_basis, local_size = function(p) rep(0.4, nrow(p))
)
stopifnot(identical(state, "SUCCEEDED"))
client$close()

# Points in, a mesh out: the unit sphere down to a height, evenly.
sphere <- function(n, lowest = -1) {
  z <- 1 - (1 - lowest) * (seq_len(n) - 0.5) / n
  turn <- seq_len(n) * pi * (3 - sqrt(5))
  cbind(sqrt(1 - z^2) * cos(turn), sqrt(1 - z^2) * sin(turn), z, deparse.level = 0)
}
points <- sphere(600)
phases <- character()
made <- reconstruct(points, 2,
  noise = 0, server = address,
  on_progress = function(progress) phases <<- union(phases, progress$phase)
)
stopifnot(made$certified, identical(made$points, points), nrow(made$simplices) == 2 * 600 - 4)
stopifnot(made$places == "OK", length(made$places) == 600, is.null(made$smoothed))
stopifnot(length(phases) > 0, range(made$simplices) == c(1, 600))
points <- sphere(2500)
around <- norm(points[, 1:2])
tangents <- array(c(
  -points[, 2] / around, points[, 1] / around, 0 * around,
  -points[, 3] * points[, 1:2] / around, around
), c(2500, 3, 2))
made <- reconstruct(points, 2, tangents, noise = 0, reach = 1, server = address)
stopifnot(identical(made$report$certificate$level, "PROVED"))
made <- reconstruct(sphere(600, -0.2), 2, noise = 0, server = address)
stopifnot(!made$certified, "EDGE" %in% made$places)
shaken <- sphere(900)
shaken <- shaken + 0.01 * sin(12.9898 * seq_along(shaken))
made <- reconstruct(shaken, 2, server = address)
stopifnot(identical(dim(made$smoothed), c(900L, 3L)), identical(made$points, shaken))
shaken[3, 2] <- NA
stopifnot(grepl("row 3 of points is", failure(reconstruct(shaken, 2, server = address))))
stopifnot(grepl("numeric matrix", failure(reconstruct(1:9, 2, server = address))))
stopifnot(grepl("less than d", failure(reconstruct(sphere(50), 3, server = address))))
server$close()
cat("R: all is well\n")
