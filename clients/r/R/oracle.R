# An oracle is a list of functions, those that the user gave, by which chunks are answered.

of_walls <- c("face_point", "clearances", "conormals")
more_methods <- c("tangent_basis", "intersect_flat", "local_size", of_walls)

# `given`: a list that may have more_methods, walls, and other things.
oracle_of <- function(closest_point, dimension, given) {
  oracle <- c(
    list(closest_point = closest_point, dimension = dimension),
    Filter(Negate(is.null), given[intersect(names(given), more_methods)])
  )
  oracle$walls <- if (is.null(given$walls)) 0L else as.integer(given$walls)
  needed <- if (oracle$walls > 0) c("tangent_basis", of_walls)
  lacking <- setdiff(needed, names(oracle))
  if (length(lacking) > 0) {
    stop("a manifold with walls needs ", paste(lacking, collapse = " and "), call. = FALSE)
  }
  for (name in intersect(names(oracle), c("closest_point", more_methods))) {
    if (!is.function(oracle[[name]])) {
      stop(name, " has to be a function, and is a ", class(oracle[[name]])[1], call. = FALSE)
    }
  }
  oracle
}

# What Python gets of it.
abilities <- function(oracle) {
  has <- function(name) !is.null(oracle[[name]])
  list(
    tangent_basis = has("tangent_basis"), intersect_flat = has("intersect_flat"),
    local_size = has("local_size"), walls = oracle$walls
  )
}

# Answers chunks until there are no more. A row of NA in an answer says that its point has none.
# `fails` is called with what the oracle stops with, after Python has it, too.
answer_all <- function(worker, oracle, each = function() NULL, fails = stop) {
  repeat {
    chunk <- reticulate::iter_next(worker)
    if (is.null(chunk)) {
      break
    }
    tryCatch(
      {
        answer <- answer_chunk(chunk, oracle)
        if (identical(fails, stop)) {
          check_finite(answer)
        }
        chunk$answer(
          answer$points, answer$tangents, answer$sizes, answer$found, answer$clearances,
          answer$conormals
        )
      },
      error = function(failure) {
        if (!chunk$answered) chunk$fail(conditionMessage(failure))
        if (identical(fails, stop)) {
          try(reticulate::iter_next(worker), silent = TRUE) # lets the server take note
        }
        fails(failure)
      }
    )
    each()
  }
}

answer_chunk <- function(chunk, oracle) {
  x <- chunk$points
  face <- as.integer(unlist(chunk$face)) + 1L
  points <- if (identical(chunk$kind, "intersect_flat")) {
    oracle$intersect_flat(x, chunk$bases, as.vector(chunk$radii))
  } else if (length(face) > 0) {
    oracle$face_point(x, face)
  } else {
    oracle$closest_point(x)
  }
  if (!is.matrix(points) || any(dim(points) != dim(x))) {
    stop("the answer to ", nrow(x), " points has to be a matrix with ", ncol(x), " columns")
  }
  found <- rowSums(is.na(points) & !is.nan(points)) == 0
  # Numbers of this shape for each row: those of points that were not found hold anything.
  at_found <- function(wanted, method, shape, ...) {
    if (!wanted) {
      return(NULL)
    }
    rows <- array(0, c(nrow(x), shape))
    if (any(found)) {
      values <- oracle[[method]](points[found, , drop = FALSE], ...)
      check_shape(method, values, c(sum(found), shape))
      rows[rep(found, prod(shape))] <- values
    }
    rows
  }
  k <- oracle$dimension
  d <- ncol(x)
  on_face <- chunk$wants_clearances && length(face) > 0
  list(
    points = points, found = as.list(found),
    tangents = at_found(chunk$wants_tangents, "tangent_basis", c(d, k)),
    sizes = at_found(chunk$wants_sizes, "local_size", integer()),
    clearances = at_found(chunk$wants_clearances, "clearances", oracle$walls),
    conormals = at_found(on_face, "conormals", c(length(face), d), face)
  )
}

# Extents of one may be left out: R drops them.
check_shape <- function(method, values, shape) {
  long <- function(extents) as.integer(extents[extents != 1])
  has <- if (is.null(dim(values))) length(values) else dim(values)
  if (!is.numeric(values) || !identical(long(has), long(shape))) {
    stop(
      method, " has to give numbers of the extents ", paste(shape, collapse = " x "),
      ", and gave ", class(values)[1], " of ", paste(has, collapse = " x ")
    )
  }
}

# In R's words; a doctor has its own for it.
check_finite <- function(answer) {
  bad <- which(unlist(answer$found) & !is.finite(rowSums(answer$points)))
  if (length(bad) > 0) {
    stop(
      "the answer for point ", bad[1], " of ", nrow(answer$points), " is ",
      paste(answer$points[bad[1], ], collapse = " "), ": a row of NA says that there is none"
    )
  }
}
