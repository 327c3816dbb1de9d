# The multiplicative algorithm by the name and arguments of REX, for rivals_test.py.
od_REX <- function(Fx, crit, alg.AA, eff, t.max, echo, track) {
  stopifnot(crit == "D", alg.AA == "REX", eff < 1, t.max > 0, !echo, !track)
  w <- rep(1 / nrow(Fx), nrow(Fx))
  repeat {
    ratio <- rowSums((Fx %*% solve(crossprod(sqrt(w) * Fx))) * Fx) / ncol(Fx)
    if (max(ratio) <= 1 / eff) break
    w <- w * ratio
  }
  list(w.best = w)
}
