# REX of the R package OptimalDesign (Harman, Filova and Richtarik 2020) as a rival, for rank one.
#
#   graybox solve set.h5 --solver "external:Rscript scripts/rivals/rex_solver.R {csv}" --gap 1e-6
#
# It takes regressors f with H = f f' and nothing else; a set of higher rank is refused. They are
# whitened, which leaves its steps as they are and helps its rounding. The package measures
# efficiency: 1 / (1 + gap) is the bound that it stops at. With the word VDM or MUL after {csv} its
# vertex-direction or its multiplicative method runs in place of REX.

if (!requireNamespace("OptimalDesign", quietly = TRUE)) {
  message("OptimalDesign is not here: install.packages('OptimalDesign') in R")
  quit(status = 1)
}
arguments <- commandArgs(trailingOnly = TRUE)
method <- if (length(arguments) > 4) arguments[2] else "REX"
rest <- tail(arguments, 3)  # graybox adds design, gap and seconds
gap <- as.numeric(rest[2])
seconds <- as.numeric(rest[3])

packed <- as.matrix(read.csv(arguments[1]))  # Q x p: lower triangles, row by row
start <- proc.time()[["elapsed"]]
d <- floor(sqrt(2 * ncol(packed)))
# R numbers a matrix column by column: the upper triangle so read is the lower triangle by rows.
place <- matrix(0L, d, d)
place[upper.tri(place, diag = TRUE)] <- seq_len(ncol(packed))
place <- pmax(place, t(place))
# f is a column of H over the root of its diagonal entry, the largest one for the least rounding.
diagonal <- packed[, diag(place), drop = FALSE]
pivot <- max.col(diagonal, ties.method = "first")
regressors <- t(vapply(seq_len(nrow(packed)), function(i) {
  column <- packed[i, place[, pivot[i]]]
  if (diagonal[i, pivot[i]] > 0) column / sqrt(diagonal[i, pivot[i]]) else 0 * column
}, numeric(d)))
left <- abs(packed - regressors[, row(place)[upper.tri(place, diag = TRUE)]] *
              regressors[, col(place)[upper.tri(place, diag = TRUE)]])
if (any(left > 1e-9 * pmax(apply(diagonal, 1, max), .Machine$double.xmin))) {
  message("REX takes rank one alone: candidate ", which(rowSums(left) > 0)[1] - 1, " is no f f'")
  quit(status = 1)
}
regressors <- regressors %*% solve(chol(crossprod(regressors) / nrow(regressors)))

found <- OptimalDesign::od_REX(regressors, crit = "D", alg.AA = method, eff = 1 / (1 + 0.9 * gap),
                               t.max = 0.8 * seconds, echo = FALSE, track = FALSE)
weights <- pmax(found$w.best, 0)
weights <- weights / sum(weights)
information <- crossprod(sqrt(weights) * regressors)
reached <- max(rowSums((regressors %*% solve(information)) * regressors)) / d - 1
status <- if (reached <= gap) "solved" else "time_limit"

support <- which(weights != 0)
points <- sprintf('{"index": %d, "weight": %.17g}', support - 1L, weights[support])  # from zero
elapsed <- proc.time()[["elapsed"]] - start
head <- sprintf('"solver": "%s", "status": "%s", "seconds": %.9g, "trace": [[%.9g, %.17g]]',
                tolower(method), status, elapsed, elapsed, reached)
writeLines(sprintf('{"format": "graybox-design/1", %s, "support": [%s]}', head,
                   paste(points, collapse = ",\n")), rest[1])
