#' Make a mesh of points on a manifold, or near it
#'
#' @param points n x d matrix, a point a row. Row i is vertex i of the mesh: none is moved.
#' @param dimension k of the manifold, 1 to 3, below d.
#' @param tangents n x d x k array, of each point a basis of its tangent space, its columns; NULL:
#'   they are estimated from the points.
#' @param noise the standard deviation of each coordinate, a length, 0: the points are exact;
#'   "auto": as they show.
#' @param reach a promise: the manifold's reach is at least this length. Exact points may then be
#'   proved.
#' @param drop the share of the points that may be left out, 0 to 0.5.
#' @param closed FALSE: the manifold may have a boundary, and the mesh ends where the points do.
#' @param server,on_progress as for `mesh`.
#' @param ... more keywords of Python's `stellate.reconstruct`: credentials, label, weights
#'   ("only": the weighted tangential Delaunay complex), steiner (TRUE: points may be added)...
#' @return list of class "stellate_mesh", as of `mesh`, and in it besides `places`, what became of
#'   each point: "OK", "TILED", ... or why it is not resolved; and `smoothed`, the positions that
#'   the complex was built on where the points are noisy, n x d, else NULL.
reconstruct <- function(points, dimension, tangents = NULL, noise = "auto", reach = NULL,
                        drop = 0.001, closed = TRUE, ..., server = NULL, on_progress = NULL) {
  if (!is.matrix(points) || !is.numeric(points)) {
    stop("points have to be a numeric matrix, a point a row, and are a ", class(points)[1])
  }
  bad <- which(!is.finite(rowSums(points)))
  if (length(bad) > 0) { # in R's numbers
    row <- paste(points[bad[1], ], collapse = " ")
    stop("row ", bad[1], " of points is ", row, ": leave it out")
  }
  finished <- python()$reconstruct(
    points, as.integer(dimension),
    tangents = tangents, noise = noise, reach = reach,
    drop = drop, closed = closed, server = server, on_progress = on_progress, ...
  )
  structure(
    list(
      points = finished$points, simplices = finished$simplices + 1L, walls = NULL,
      places = as.character(finished$places), smoothed = finished$smoothed,
      certified = finished$certified, report = finished$report, python = finished
    ),
    class = "stellate_mesh"
  )
}
