% As much of SDPT3 as scripts/rivals/sdpt3_solver.m asks for, for rivals_test.py: the multiplicative
% algorithm on maximise log det Z, Z = smat(y), z = C{2} - At{2} y >= 0.
function [obj, X] = sqlp(blk, At, C, b, options)
  d = blk{1, 2};
  p = d * (d + 1) / 2;
  assert(strcmp(blk(:, 1), {'s'; 'l'}) && size(At{2}, 1) == blk{2, 2});
  assert(isequal(full(At{1}), -eye(p)) && ~any(C{1}(:)) && isequal(b, zeros(p, 1)));
  assert(isequal(options.parbarrier{1}, 1) && ~any(options.parbarrier{2}));
  norms = d ./ C{2};
  lines = At{2} .* norms;
  upper = find(triu(ones(d)));
  scale = sqrt(2) - (sqrt(2) - 1) * eye(d);
  weights = ones(blk{2, 2}, 1) / blk{2, 2};
  for k = 1:100000
    M = zeros(d);
    M(upper) = (lines' * weights) ./ scale(upper);
    W = inv(M + triu(M, 1)');
    ratio = lines * (scale(upper) .* W(upper)) / d;
    if max(ratio) - 1 <= max(options.gaptol, 1e-5)
      break
    end
    weights = weights .* ratio;
  end
  obj = -log(det(W));
  X = {inv(W); weights .* norms};
end
