# Meshing and serving from R. The Python client does the talking; the loops below are R's own, since
# R must not be called from other threads.

python <- function() reticulate::import("stellate")

# Answers chunks until there are no more. A row of NA in an answer says that its point has none.
answer_all <- function(worker, oracle, each = function() NULL) {
  repeat {
    chunk <- reticulate::iter_next(worker)
    if (is.null(chunk)) {
      break
    }
    answer <- tryCatch(
      answer_chunk(chunk, oracle),
      error = function(failure) {
        chunk$fail(conditionMessage(failure))
        try(reticulate::iter_next(worker), silent = TRUE) # lets the server take note
        stop(failure)
      }
    )
    chunk$answer(answer$points, answer$tangents, answer$sizes, answer$found)
    each()
  }
}

answer_chunk <- function(chunk, oracle) {
  x <- chunk$points
  points <- if (identical(chunk$kind, "intersect_flat")) {
    oracle$intersect_flat(x, chunk$bases, as.vector(chunk$radii))
  } else {
    oracle$closest_point(x)
  }
  if (!is.matrix(points) || any(dim(points) != dim(x))) {
    stop("the answer to ", nrow(x), " points has to be a matrix with ", ncol(x), " columns")
  }
  found <- !is.na(rowSums(points))
  answer <- list(points = points, tangents = NULL, sizes = NULL, found = as.list(found))
  on_manifold <- points[found, , drop = FALSE]
  if (chunk$wants_tangents) {
    k <- oracle$dimension
    tangents <- array(diag(1, ncol(x), k)[rep(seq_len(ncol(x) * k), each = nrow(x))], c(dim(x), k))
    if (any(found)) {
      tangents[found, , ] <- oracle$tangent_basis(on_manifold)
    }
    answer$tangents <- tangents
  }
  if (chunk$wants_sizes) {
    sizes <- rep(1, nrow(x))
    if (any(found)) {
      sizes[found] <- oracle$local_size(on_manifold)
    }
    answer$sizes <- as.list(sizes)
  }
  answer
}

#' Mesh a manifold
#'
#' @param closest_point function of an n x d matrix: a nearest point of the manifold for each row; a
#'   row of NA where there is none.
#' @param dimension,ambient_dimension k and d.
#' @param epsilon largest circumradius of a simplex, a length.
#' @param bounding_box list(lower, upper), where the manifold is; or `seeds`, an m x d matrix of
#'   points near it, one at least on each component.
#' @param tangent_basis function of points of the manifold: orthonormal columns, n x d x k.
#' @param intersect_flat function (centers, bases, radii): the nearest point of the manifold in
#'   the flat through each center that is orthogonal to the columns of its basis, within the
#'   radius, else NA.
#' @param local_size function of points of the manifold: lengths.
#' @param server "host:port"; by default a server is started.
#' @param on_progress function of the progress, called on R's thread.
#' @param ... more keywords of Python's `stellate.pull`: size_rate, max_vertices, credentials...
#' @return list of class "stellate_mesh": `points` (n x d), `simplices` (m x (k+1), counted from
#'   one), `certified`, `report`, and `python`, the Python package's mesh, with `python$save`.
mesh <- function(closest_point, dimension, ambient_dimension, epsilon, bounding_box = NULL,
                 seeds = NULL, tangent_basis = NULL, intersect_flat = NULL, local_size = NULL,
                 server = NULL, on_progress = NULL, ...) {
  worker <- python()$pull(
    as.integer(dimension), as.integer(ambient_dimension), epsilon, server,
    bounding_box = bounding_box, seeds = seeds, intersect_flat = !is.null(intersect_flat),
    tangent_basis = !is.null(tangent_basis), local_size = !is.null(local_size), ...
  )
  on.exit(worker$close())
  oracle <- list(
    dimension = dimension, closest_point = closest_point, tangent_basis = tangent_basis,
    intersect_flat = intersect_flat, local_size = local_size
  )
  answer_all(worker, oracle, function() {
    if (!is.null(on_progress) && !is.null(worker$progress)) on_progress(worker$progress)
  })
  finished <- worker$mesh
  structure(
    list(
      points = finished$points, simplices = finished$simplices + 1L,
      certified = finished$certified, report = finished$report, python = finished
    ),
    class = "stellate_mesh"
  )
}

#' One more worker for a mesh, until it is over
#'
#' @param name "meshes/...".
#' @param ... the functions that the mesh was declared with, as for `mesh`.
#' @return the state that the mesh ended in, e.g. "SUCCEEDED".
serve <- function(closest_point, name, server, ..., credentials = NULL) {
  client <- python()$Client(server, credentials)
  on.exit(client$close())
  worker <- client$pull(name)
  on.exit(worker$close(), add = TRUE, after = FALSE)
  spec <- client$get(name)
  oracle <- list(closest_point = closest_point, dimension = spec$dimension, ...)
  answer_all(worker, oracle)
  worker$state
}

print.stellate_mesh <- function(x, ...) {
  cat(reticulate::py_str(x$python), reticulate::py_str(x$report), "", sep = "\n")
  invisible(x)
}
