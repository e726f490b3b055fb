# Meshing and serving from R. The Python client does the talking; the loops are R's own, since R
# must not be called from other threads.

python <- function() reticulate::import("stellate")

#' Mesh a manifold
#'
#' @param closest_point function of an n x d matrix: a nearest point of the manifold for each row; a
#'   row of NA where there is none.
#' @param dimension,ambient_dimension k and d.
#' @param epsilon largest circumradius of a simplex, a length; or "auto": a quarter of the reach
#'   that `check` finds, and, where the mesh came out too coarse to certify, of the reach that its
#'   certificate shows, twice at most.
#' @param bounding_box list(lower, upper), where the manifold is; or `seeds`, an m x d matrix of
#'   points near it, one at least on each component.
#' @param ... what else the oracle can answer:
#'   - `tangent_basis`: function of points of the manifold: orthonormal columns, n x d x k.
#'   - `intersect_flat`: function (centers, bases, radii): the nearest point of the manifold in
#'     the flat through each center that is orthogonal to the columns of its basis, within the
#'     radius, else NA.
#'   - `local_size`: function of points of the manifold: lengths.
#'   - `walls`: how many walls bound the manifold, which has a boundary then: it is where all walls
#'     are at least 0 on a manifold without one, which the functions above describe; it may be R^d
#'     itself. Walls take `tangent_basis` and three functions more. `face_point` (points, face):
#'     as `closest_point`, where the walls of the face, their numbers from one, ascending, are 0,
#'     whatever the others are. `clearances` (points): n x walls, their values, whose signs
#'     count. `conormals` (points, face): of each wall of the face the unit normal within the
#'     tangent space along which its value falls, n x length(face) x d.
#'
#'   and more keywords of Python's `stellate.pulling.pull`: size_rate, max_vertices, credentials...
#' @param server "host:port"; by default a server is started.
#' @param checkpoint a directory, made if it is not there, in which the mesh outlives this R: the
#'   same call goes on from where the last one was interrupted or killed, or its oracle stopped,
#'   and gives a mesh that is finished immediately.
#' @param on_progress function of the progress, called on R's thread.
#' @return list of class "stellate_mesh": `points` (n x d), `simplices` (m x (k+1), counted from
#'   one), `walls` (n x walls, whether a point lies on a wall; NULL without a boundary),
#'   `certified`, `report`, and `python`, the Python package's mesh, with `python$save`.
mesh <- function(closest_point, dimension, ambient_dimension, epsilon, bounding_box = NULL,
                 seeds = NULL, ..., server = NULL, checkpoint = NULL, on_progress = NULL) {
  given <- list(...)
  oracle <- oracle_of(closest_point, dimension, given)
  worker <- do.call(python()$pulling$pull, c(
    list(
      as.integer(dimension), as.integer(ambient_dimension), epsilon, server,
      bounding_box = bounding_box, seeds = seeds, checkpoint = checkpoint
    ),
    abilities(oracle), given[setdiff(names(given), c(more_methods, "walls"))]
  ))
  on.exit(worker$close())
  answer_all(worker, oracle, function() {
    if (!is.null(on_progress) && !is.null(worker$progress)) on_progress(worker$progress)
  })
  finished <- worker$mesh
  structure(
    list(
      points = finished$points, simplices = finished$simplices + 1L,
      walls = on_walls(finished, oracle$walls), certified = finished$certified,
      report = finished$report, python = finished
    ),
    class = "stellate_mesh"
  )
}

on_walls <- function(finished, walls) {
  if (walls == 0 || is.null(finished$walls)) {
    return(NULL)
  }
  has <- function(bits, bit) bits %/% bit %% 2 == 1
  outer(as.numeric(finished$walls), 2^(seq_len(walls) - 1), has)
}

#' The boundary of a mesh
#'
#' @param mesh of a manifold with boundary.
#' @return list of its parts, one for each wall: `walls`, the numbers, from one, of those that the
#'   part lies on, and `simplices`, m x k, counted from one.
boundary <- function(mesh) {
  lapply(mesh$python$boundary, function(face) {
    list(walls = unlist(face$walls) + 1L, simplices = face$simplices + 1L)
  })
}

#' Probe an oracle for its contract, before a mesh is made of its answers
#'
#' What its functions stop with is a finding, too.
#'
#' @param closest_point,dimension,ambient_dimension,bounding_box,seeds as for `mesh`.
#' @param epsilon that a mesh is planned with.
#' @param ... what else the oracle can answer, as for `mesh`.
#' @return list of class "stellate_check": `ok`, whether there is no error; `findings`, a data frame
#'   of `severity`, `code`, `message` and `advice`; `reach`, an estimate from above, or NULL;
#'   `python`, the Python package's report. Printing it tells all of it.
check <- function(closest_point, dimension, ambient_dimension, bounding_box = NULL, seeds = NULL,
                  epsilon = NULL, ...) {
  oracle <- oracle_of(closest_point, dimension, list(...))
  worker <- do.call(python()$pulling$pull_check, c(
    list(
      as.integer(dimension), as.integer(ambient_dimension), epsilon,
      bounding_box = bounding_box, seeds = seeds
    ),
    abilities(oracle)
  ))
  on.exit(worker$close())
  answer_all(worker, oracle, fails = function(failure) NULL)
  report <- worker$report
  column <- function(of) vapply(report$findings, of, "")
  findings <- data.frame(
    severity = column(function(finding) finding$severity),
    code = column(function(finding) finding$code),
    message = column(function(finding) finding$message),
    advice = column(function(finding) finding$advice)
  )
  structure(
    list(ok = report$ok, findings = findings, reach = report$reach, python = report),
    class = "stellate_check"
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
  info <- client$get(name)
  # The dimension of the manifold: the boundary alone has simplices of one dimension less.
  oracle <- oracle_of(closest_point, info$dimension + info$boundary_only, list(...))
  worker <- do.call(client$pull, c(list(name), abilities(oracle)))
  on.exit(worker$close(), add = TRUE, after = FALSE)
  answer_all(worker, oracle)
  worker$state
}

print.stellate_mesh <- function(x, ...) {
  cat(reticulate::py_str(x$python), reticulate::py_str(x$report), "", sep = "\n")
  invisible(x)
}

print.stellate_check <- function(x, ...) {
  cat(reticulate::py_str(x$python), "\n", sep = "")
  invisible(x)
}
