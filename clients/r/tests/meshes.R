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

# A mesh of others.
client <- python$Client(address)
declared <- client$create(python$manifolds$Torus(), 0.1) # with tangents and sizes
state <- serve(torus$closest_point, declared$name, address,
  tangent_basis = torus$tangent_basis, local_size = function(p) rep(0.4, nrow(p))
)
stopifnot(identical(state, "SUCCEEDED"))
client$close()
server$close()
cat("R: all is well\n")
