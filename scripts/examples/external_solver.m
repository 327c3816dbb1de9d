% A solver for graybox in Octave or MATLAB: the multiplicative algorithm.
%
%   graybox solve set.h5 --gap 1e-3 --solver \
%     "external:octave-cli --path scripts/examples --eval \"external_solver('{csv}', '{design}', {gap}, {seconds})\""
%
% In MATLAB: matlab -batch "addpath scripts/examples; external_solver(...)", with the same words.
function external_solver(problem, design, gap, seconds)
  packed = dlmread(problem, ',', 1, 0);  % Q x p: lower triangles, row by row; a header line
  count = size(packed, 1);
  d = floor(sqrt(2 * size(packed, 2)));
  % A matrix is numbered column by column: its upper triangle is then the lower one by rows.
  upper = find(triu(ones(d)));
  twice = 2 * ones(d) - eye(d);          % tr(W H) = sum of twice * W * H over the triangle

  start = tic;
  weights = ones(count, 1) / count;
  while true
    M = zeros(d);
    M(upper) = packed' * weights;
    W = inv(M + triu(M, 1)');
    sensitivity = packed * (twice(upper) .* W(upper));
    solved = max(sensitivity) / d - 1 <= gap;
    if solved || toc(start) > 0.9 * seconds
      break
    end
    weights = weights .* sensitivity / d;
    weights = weights / sum(weights);
  end

  status = 'time_limit';
  if solved
    status = 'solved';
  end
  support = find(weights);
  file = fopen(design, 'w');
  fprintf(file, '{"format": "graybox-design/1", "status": "%s", "support": [', status);
  fprintf(file, '{"index": %d, "weight": %.17g}', support(1) - 1, weights(support(1)));
  fprintf(file, ',\n{"index": %d, "weight": %.17g}', [support(2:end)' - 1; weights(support(2:end))']);
  fprintf(file, ']}\n');
  fclose(file);
end
