# A solver for graybox in Julia, with its standard library alone: the multiplicative algorithm.
#
#   graybox solve set.h5 --solver "external:julia scripts/examples/external_solver.jl {csv}" --gap 1e-3
using DelimitedFiles, LinearAlgebra

function multiplicative(packed, gap, seconds)
    d = floor(Int, sqrt(2 * size(packed, 2)))
    # Row by row: entry k of a packed matrix stands at rows[k], columns[k].
    rows = [i for i in 1:d for j in 1:i]
    columns = [j for i in 1:d for j in 1:i]
    place = CartesianIndex.(rows, columns)
    twice = ifelse.(rows .== columns, 1.0, 2.0)  # tr(W H) = sum of twice * W * H over the triangle
    start = time()
    weights = fill(1 / size(packed, 1), size(packed, 1))
    while true
        M = zeros(d, d)
        M[place] = packed' * weights
        W = inv(Symmetric(M, :L))
        sensitivity = packed * (twice .* W[place])
        solved = maximum(sensitivity) / d - 1 <= gap
        if solved || time() - start > 0.9 * seconds
            return weights, solved
        end
        weights .*= sensitivity ./ d
        weights ./= sum(weights)
    end
end

problem, design, gap, seconds = ARGS
packed, _ = readdlm(problem, ',', Float64; header = true)
weights, solved = multiplicative(packed, parse(Float64, gap), parse(Float64, seconds))
points = ["{\"index\": $(i - 1), \"weight\": $(weights[i])}" for i in eachindex(weights) if weights[i] != 0]
open(design, "w") do file
    print(file, "{\"format\": \"graybox-design/1\", \"status\": \"", solved ? "solved" : "time_limit",
          "\", \"support\": [", join(points, ",\n"), "]}\n")
end
