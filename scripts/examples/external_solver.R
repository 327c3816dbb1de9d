# A solver for graybox in base R: the multiplicative algorithm.
#
#   graybox solve set.h5 --solver "external:Rscript scripts/examples/external_solver.R {csv}" --gap 1e-3

arguments <- commandArgs(trailingOnly = TRUE)
gap <- as.numeric(arguments[3])
seconds <- as.numeric(arguments[4])

packed <- as.matrix(read.csv(arguments[1]))  # Q x p: lower triangles, row by row
d <- floor(sqrt(2 * ncol(packed)))
# R numbers a matrix column by column: the upper triangle so read is the lower triangle by rows.
upper <- upper.tri(diag(d), diag = TRUE)
twice <- ifelse(row(diag(d)) == col(diag(d)), 1, 2)[upper]  # tr(W H) over the triangle

start <- proc.time()[["elapsed"]]
weights <- rep(1 / nrow(packed), nrow(packed))
repeat {
  matrix <- matrix(0, d, d)
  matrix[upper] <- crossprod(packed, weights)
  inverse <- chol2inv(chol(matrix))  # chol() reads the upper triangle alone
  sensitivity <- drop(packed %*% (twice * inverse[upper]))
  solved <- max(sensitivity) / d - 1 <= gap
  if (solved || proc.time()[["elapsed"]] - start > 0.9 * seconds) break
  weights <- weights * sensitivity / d
  weights <- weights / sum(weights)
}

support <- which(weights != 0)
points <- sprintf('{"index": %d, "weight": %.17g}', support - 1L, weights[support])  # from zero
writeLines(sprintf('{"format": "graybox-design/1", "status": "%s", "support": [%s]}',
                   if (solved) "solved" else "time_limit", paste(points, collapse = ",\n")),
           arguments[2])
