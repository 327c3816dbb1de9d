% SDPT3 4.0 in Octave or MATLAB as a rival of the back-ends, in the form that suits it best.
%
%   graybox solve set.h5 --gap 1e-6 --solver "external:octave-cli --eval \"addpath scripts/rivals; \
%     sdpt3_solver('{csv}', '{design}', {gap}, {seconds})\""
%
% SDPT3 has to be on the path (OCTAVE_PATH=.../SDPT3/Solver:...). It gets the dual problem in its own
% dual form: maximise log det Z, where Z = W is a semidefinite block, and z_i = d - tr(W H_i) a linear
% one, each divided by the norm of its matrix. The variables are the d(d+1)/2 entries of W, whatever
% Q is; the weights are the primal variables of the linear block. The set is whitened by its mean.
% Tolerances are tightened until the gap is met, it gives up, or half the time is over.
function sdpt3_solver(problem, design, gap, seconds)
  packed = dlmread(problem, ',', 1, 0);  % Q x p: lower triangles, row by row; a header line
  start = tic;
  [count, p] = size(packed);
  d = floor(sqrt(2 * p));
  % Octave numbers a matrix column by column: its upper triangle is then the lower one by rows, and
  % that is the order of SDPT3's svec(), which has off-diagonal entries times sqrt 2.
  upper = find(triu(ones(d)));
  svec_weight = sqrt(2) - (sqrt(2) - 1) * eye(d);
  root = chol(full_matrix(mean(packed, 1), d, upper));
  lines = zeros(count, p);
  for i = 1:count
    H = root' \ full_matrix(packed(i, :), d, upper) / root;
    lines(i, :) = (svec_weight(upper) .* H(upper))';
  end
  norms = max(sqrt(sum(lines .^ 2, 2)), realmin);

  blk = {'s', d; 'l', count};
  At = {-speye(p); lines ./ norms};  % Z = C - A'y: W = smat(y), and d - svec(H_i)'y
  C = {sparse(d, d); d ./ norms};
  options = struct('printlevel', 0, 'maxit', 200);
  options.parbarrier = {1; zeros(1, count)};
  best = ones(count, 1) / count;
  reached = Inf;
  trace = '';
  tolerance = min(1e-8, 0.1 * gap);
  message = '';
  if exist('sqlp', 'file') == 0
    message = 'SDPT3 is not here: put it on OCTAVE_PATH';
  end
  while isempty(message) && reached > gap && tolerance > 1e-15 && toc(start) < 0.5 * seconds
    options.gaptol = options.inftol = tolerance;
    [~, X] = sqlp(blk, At, C, zeros(p, 1), options);
    weights = max(X{2}(:) ./ norms, 0);
    weights /= sum(weights);
    M = full_matrix((lines' * weights)' ./ svec_weight(upper)', d, upper);
    W = inv(M);
    found = max(lines * (svec_weight(upper) .* W(upper))) / d - 1;
    if found < reached
      best = weights;
      reached = found;
    end
    trace = [trace, sprintf('%s[%.9g, %.17g]', repmat(', ', 1, ~isempty(trace)), toc(start), reached)];
    tolerance *= 0.01;
  end

  status = 'numerical_failure';
  if reached <= gap
    status = 'solved';
  elseif toc(start) >= 0.5 * seconds
    status = 'time_limit';
  elseif isempty(message)
    message = sprintf('SDPT3 ended at a gap of %.2g', reached);
  end
  support = find(best);
  file = fopen(design, 'w');
  fprintf(file, '{"format": "graybox-design/1", "solver": "sdpt3", "status": "%s", "message": "%s",', ...
          status, message);
  fprintf(file, '"seconds": %.9g, "trace": [%s], "support": [', toc(start), trace);
  fprintf(file, '{"index": %d, "weight": %.17g}', support(1) - 1, best(support(1)));
  fprintf(file, ',\n{"index": %d, "weight": %.17g}', [support(2:end)' - 1; best(support(2:end))']);
  fprintf(file, ']}\n');
  fclose(file);
end

function H = full_matrix(line, d, upper)
  H = zeros(d);
  H(upper) = line;
  H = H + triu(H, 1)';
end
