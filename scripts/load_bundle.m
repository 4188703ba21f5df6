function bundle = load_bundle(folder)
% LOAD_BUNDLE  Load a fluxform bundle: GNU Octave 7, or MATLAB R2016b and newer; no toolbox.
%
%   addpath scripts
%   bundle = load_bundle('results/seed/flat');
%   force = bundle.force_per_ampere([0.01, 0, 0.05]);   % N/A, one row a point, one column a coil
%   total = force * bundle.currents_a;                  % N
%   total = total + bundle.passive_force([0.01, 0, 0.05]);   % N, the unpowered steel's pull
%   h = bundle.height([0.01, 0]);                       % m, NaN where there is no surface
%   [current, force, answer] = bundle.currents([0.01, 0, 0.05]);   % with position feedback (eq. 8)
%   force = bundle.force_vectors_per_ampere([0.01, 0, 0.05]);   % N/A: point, coil, then x, y, z
%   wanted = bundle.requested_force([0.01, 0]);         % N along x, y, z
%
% Fields: manifest and lambda (manifest.json, lambda.json), points (the columns of points.csv by
% name), currents_a (one row a coil), lambda_n_per_m (empty if none), map: the arrays of map.npz,
% gz_t_per_m_per_a as [coil, z, y, x]. Coils are numbered from 0 as everywhere, so coil k is row
% or column k + 1. Points are rows of x, y, z in m. What lies outside the map has no force.
% Currents are those of least power whose force is lambda times the height, or the nearest force:
% A, one row a point, one column a coil; the force they give, N; 'ok', 'saturated' or 'outside'. Of bundles
% that request a force vector the force has three columns.
%
% Bundles are not trusted: what is wrong with one ends in an error 'fluxform:bundle'. Sizes are checked, and SHA-256 digests where there is a way to compute them (Octave, or MATLAB
% with Java). JSON may lose the last digit of a number; map.npz and the tables do not.

    try
        bundle = loaded(folder);
    catch problem
        if strcmp(problem.identifier, 'fluxform:bundle')
            rethrow(problem);
        end
        error('fluxform:bundle', '%s: a part is missing or of the wrong kind: %s', folder, problem.message);
    end
end

function bundle = loaded(folder)
    bundle.manifest = read_manifest(folder);
    files = read_files(folder, bundle.manifest.files);
    bundle.lambda = decoded(files.lambda_json, 'lambda.json');
    bundle.points = columns_of(files.points_csv, 'points.csv');
    currents = columns_of(files.currents_csv, 'currents.csv');
    bundle.currents_a = currents.current_a;
    map = read_npz(fullfile(folder, 'map.npz'));
    bundle.map = map;
    bundle.lambda_n_per_m = [];
    if isfield(map, 'lambda_n_per_m')
        bundle.lambda_n_per_m = map.lambda_n_per_m;
    end
    check(map, bundle);
    bundle.force_per_ampere = @(points_m) force_per_ampere(map, points_m);
    bundle.force_vectors_per_ampere = @(points_m) force_vectors_per_ampere(map, points_m);
    bundle.requested_force = @(points_m) requested_force(map, points_m);
    bundle.passive_force = @(points_m) passive_force(map, points_m);
    bundle.height = @(points_m) height(map, points_m);
    bundle.currents = @(points_m) feedback(map, points_m);
    bundle.robust_currents = @(points_m) robust_feedback(map, points_m);
end

function force = force_per_ampere(map, points_m)
% Upward force on the magnet's centre, N/A: the sum over i of m_i dB_i/dz.
    m = map.moment_a_m2;
    force = zeros(size(points_m, 1), numel(map.current_max_a));
    near = around(map, points_m);
    if m(1) == 0 && m(2) == 0
        found = m(3) * interpolate(near, map.gz_t_per_m_per_a, 1, 1);
    else
        found = 0;
        for i = 1:3
            found = found + m(i) * interpolate(near, map.gradient_t_per_m_per_a, i, 3);
        end
    end
    force(:, map.coil + 1) = found.';
end

function force = force_vectors_per_ampere(map, points_m)
% Force on the magnet's centre, N/A: point, coil, then x, y, z.
    if ~isfield(map, 'gx_t_per_m_per_a')
        error('fluxform:bundle', 'map.npz holds the upward force alone: calibrate with force = "vertical-only"');
    end
    m = map.moment_a_m2;
    force = zeros(size(points_m, 1), numel(map.current_max_a), 3);
    maps = {map.gx_t_per_m_per_a, map.gy_t_per_m_per_a, map.gz_t_per_m_per_a};
    near = around(map, points_m);
    for axis = 1:3
        if m(1) == 0 && m(2) == 0
            found = m(3) * interpolate(near, maps{axis}, 1, 1);
        else
            found = 0;                            % F = grad(m . B): all of the gradient counts
            for i = 1:3
                found = found + m(i) * interpolate(near, map.gradient_t_per_m_per_a, i, axis);
            end
        end
        force(:, map.coil + 1, axis) = found.';
    end
end

function wanted = requested_force(map, points_m)
% The force vector requested, N: lambda times the height, upward unless the bundle requests another
% direction; zero where there is no surface.
    direction = repmat([0, 0, 1], size(points_m, 1), 1);
    if isfield(map, 'requested_direction')
        for k = 1:3
            direction(:, k) = on_surface(map, map.requested_direction(:, :, k), points_m);
        end
    end
    wanted = map.lambda_n_per_m * height(map, points_m) .* direction;
    wanted(isnan(wanted)) = 0;
end

function force = passive_force(map, points_m)
% What the unpowered steel adds to the force, N, up positive; zero for bundles without it.
    force = zeros(size(points_m, 1), 1);
    if isfield(map, 'passive_force_n')
        values = reshape(map.passive_force_n, [1, size(map.passive_force_n)]);
        force(:) = interpolate(around(map, points_m), values, 1, 1);
    end
end

function near = around(map, points_m)
% The nodes that take part at every point along x, y and z, and their weights; none outside.
    near = repmat(struct('x', [], 'y', [], 'z', [], 'weight', []), size(points_m, 1), 1);
    for p = 1:size(points_m, 1)
        [near(p).x, wx] = stencil(map.x_m, points_m(p, 1));
        [near(p).y, wy] = stencil(map.y_m, points_m(p, 2));
        [near(p).z, wz] = stencil(map.z_m, points_m(p, 3));
        near(p).weight = kron(wx, kron(wy, wz)).';
    end
end

function found = interpolate(near, values, i, axis)
% Values [map, z, y, x, i, axis] at points: tricubic Lagrange, one row a map, one column a point; 0 outside.
    found = zeros(size(values, 1), numel(near));
    for p = 1:numel(near)
        if isempty(near(p).weight)
            continue
        end
        part = values(:, near(p).z, near(p).y, near(p).x, i, axis);
        found(:, p) = reshape(part, size(values, 1), []) * near(p).weight;
    end
end

function [index, weight] = stencil(nodes, position)
% The nodes of an axis that take part at a position, and their weights; none outside.
    index = [];
    weight = [];
    % Computed otherwise the same coordinate has other last bits: a billionth of a cell beyond an end is at it.
    slack = [0, 0];
    if numel(nodes) > 1
        slack = 1e-9 * [nodes(2) - nodes(1), nodes(end) - nodes(end - 1)];
    end
    if ~(nodes(1) - slack(1) <= position && position <= nodes(end) + slack(2))
        return
    end
    count = min(4, numel(nodes));
    above = sum(nodes <= position);
    start = min(max(above - 2, 0), numel(nodes) - count);
    index = start + (1:count);
    near = reshape(nodes(index), 1, count);
    all_ones = ones(count, 1);
    from = all_ones * (position - near);
    apart = near.' * all_ones.' - all_ones * near;
    own = 1:count + 1:count * count;
    from(own) = 1;
    apart(own) = 1;
    weight = (prod(from, 2) ./ prod(apart, 2)).';
end

function found = height(map, points_m)
% The surface's height, m, bilinear between the bundle's points; NaN where there is none.
    if ~isfield(map, 'height_m')
        error('fluxform:bundle', 'map.npz holds no heights, as before schema 1.2: calibrate again');
    end
    found = on_surface(map, map.height_m, points_m);
end

function found = on_surface(map, values, points_m)
% Values [y, x] at points, bilinear; NaN where there is no surface.
    found = NaN(size(points_m, 1), 1);
    for p = 1:size(points_m, 1)
        [column, s] = between(map.height_x_m, points_m(p, 1));
        [row, t] = between(map.height_y_m, points_m(p, 2));
        if isempty(column) || isempty(row)
            continue
        end
        % A node of no weight is not asked: it may lie beyond the grid.
        columns = column + [0, s > 0];
        rows = row + [0, t > 0];
        if all(all(map.has_height(rows, columns)))
            found(p) = [1 - t, t] * values(rows, columns) * [1 - s; s];
        end
    end
end

function [cell, share] = between(nodes, position)
% The cell that holds a position and the position's share of its width; none outside.
    cell = [];
    share = 0;
    if numel(nodes) == 1
        cell = find(nodes == position);
        return
    end
    below = max(min(sum(nodes <= position), numel(nodes) - 1), 1);
    part = (position - nodes(below)) / (nodes(below + 1) - nodes(below));
    % Computed otherwise the same coordinate has other last bits: a billionth from a node is at it.
    if abs(part) <= 1e-9
        cell = below;
    elseif abs(part - 1) <= 1e-9
        cell = below + 1;
    elseif part > 0 && part < 1
        cell = below;
        share = part;
    end
end

function [currents, force, answers] = feedback(map, points_m)
% Currents of least power at every position, A, their force, N, and how well it is met.
    if ~isfield(map, 'lambda_n_per_m')
        error('fluxform:bundle', 'the bundle has no force constant: nothing can be rendered');
    end
    total = Inf;
    if isfield(map, 'total_current_max_a')
        total = map.total_current_max_a;
    end
    vector = isfield(map, 'requested_direction');
    if vector
        vectors = force_vectors_per_ampere(map, points_m);
        requested = requested_force(map, points_m);
    end
    per_ampere = force_per_ampere(map, points_m);
    passive = passive_force(map, points_m);
    wanted = map.lambda_n_per_m * height(map, points_m);
    wanted(isnan(wanted)) = 0;
    count = size(points_m, 1);
    currents = zeros(count, numel(map.current_max_a));
    force = zeros(count, 1 + 2 * vector);
    words = {'saturated', 'ok'};
    answers = repmat({'outside'}, count, 1);
    axes_m = {map.x_m, map.y_m, map.z_m};
    for p = 1:count
        if any(arrayfun(@(k) isempty(stencil(axes_m{k}, points_m(p, k))), 1:3))
            continue
        end
        if vector
            own = reshape(vectors(p, :, :), [], 3);
            pull = [0, 0, passive(p)];
            [currents(p, :), met] = allocate_vector(own, requested(p, :) - pull, map.resistance_ohm, ...
                                                    map.current_min_a, map.current_max_a, total, ...
                                                    map.sideways_weight);
            force(p, :) = currents(p, :) * own + pull;
            answers{p} = words{1 + met};
            continue
        end
        [currents(p, :), met] = allocate(per_ampere(p, :), wanted(p) - passive(p), map.resistance_ohm, ...
                                         map.current_min_a, map.current_max_a, total);
        force(p) = per_ampere(p, :) * currents(p, :).' + passive(p);
        answers{p} = words{1 + met};
    end
end

function [currents, force, answers] = robust_feedback(map, points_m)
% As feedback, with the currents of the least expected error under the uncertainties that the bundle was made
% with: the algorithm of src/lambda/uncertainty/error_form.rs.
    if ~isfield(map, 'robust_setting')
        error('fluxform:bundle', 'map.npz holds no robust_setting: the bundle was made without uncertainties');
    end
    [currents, force, answers] = feedback(map, points_m);
    total = Inf;
    if isfield(map, 'total_current_max_a')
        total = map.total_current_max_a;
    end
    vector = isfield(map, 'requested_direction');
    requested = requested_force(map, points_m);
    setting = map.robust_setting;
    low = [map.x_m(1), map.y_m(1), map.z_m(1)];
    high = [map.x_m(end), map.y_m(end), map.z_m(end)];
    % The rule of degree 5 of Hammer and Stroud over a box.
    diagonals = 1 - 2 * [bitget(0:7, 1); bitget(0:7, 2); bitget(0:7, 3)].';
    rule = [kron(0.7958224257542215 * eye(3), [1; -1]); 0.7587869106393281 * diagonals];
    weights = [repmat(40 / 361, 1, 6), repmat(121 / 2888, 1, 8)];
    if setting(2) == 0
        rule = zeros(1, 3);
        weights = 1;
    end
    for p = find(~strcmp(answers, 'outside')).'
        places = points_m(p, 1:3) + setting(2) * rule;
        places = min(max(places, repmat(low, size(places, 1), 1)), repmat(high, size(places, 1), 1));
        % The pull goes with the square of the strength, which is even between its least and 1: mean of the cube
        % over the mean.
        pull = passive_force(map, places) * (1 + (2 * setting(4) - 1) ^ 2) / 2;
        form.lower = map.current_min_a.';
        form.upper = map.current_max_a.';
        form.linear = zeros(numel(form.upper), 1);
        form.matrix = diag(setting(1) * map.resistance_ohm);
        for k = 1:numel(weights)
            [rows, wanted] = components(map, places(k, :), vector, requested(p, :), pull(k));
            square = weights(k) * setting(3);
            form.matrix = form.matrix + square * (rows * rows.') + diag(square * setting(5) * sum(rows .^ 2, 2));
            form.linear = form.linear + weights(k) * setting(4) * (rows * wanted);
        end
        currents(p, :) = least_expected_error(form, total, currents(p, :).').';
        own = components(map, points_m(p, 1:3), vector, requested(p, :), 0);
        force(p, :) = currents(p, :) * own;
        force(p, end) = force(p, end) + passive_force(map, points_m(p, 1:3));
    end
end

function [rows, wanted] = components(map, place, vector, requested, pull)
% Forces per ampere at a place, [coil, component], and what the currents are to give.
    wanted = requested.' - [0; 0; pull];
    if vector
        rows = reshape(force_vectors_per_ampere(map, place), [], 3);
    else
        rows = force_per_ampere(map, place).';
        wanted = wanted(3);
    end
end

function currents = least_expected_error(form, total, currents)
% The least value within the box and the limit of the sum, from currents within both.
    currents = within_box(form, 0, currents);
    if sum(currents) <= total * (1 + 1e-12)
        return
    end
    % Where coils push against each other the multiplier may have to outweigh more than their pulls.
    low = 0;
    high = max([realmin; abs(form.linear)]);
    within = within_box(form, high, zeros(size(currents)));
    while sum(within) > total
        low = high;
        high = 2 * high;
        within = within_box(form, high, within);
    end
    for round = 1:80
        middle = 0.5 * (low + high);
        currents = within_box(form, middle, currents);
        if sum(currents) > total
            low = middle;
            continue
        end
        high = middle;
        within = currents;
        if sum(currents) >= total * (1 - 1e-12)
            break
        end
    end
    currents = within;
end

function currents = within_box(form, price, currents)
% The least value of I'AI - 2 (b - price)'I over the box, from currents within it.
    free = find(currents > form.lower & currents < form.upper).';
    for turn = 1:20 * numel(currents) + 20
        others = currents;
        others(free) = 0;
        rest = form.linear - price - form.matrix * others;
        aim = form.matrix(free, free) \ rest(free);
        share = 1;
        meets = 0;
        for k = 1:numel(free)
            own = currents(free(k));
            limits = [form.lower(free(k)), form.upper(free(k))];
            limit = limits(1 + (aim(k) > own));
            part = (limit - own) / (aim(k) - own);
            if (aim(k) > limits(2) || aim(k) < limits(1)) && part < share
                share = part;
                meets = k;
                bound = limit;
            end
        end
        moved = currents(free) + share * (aim - currents(free));
        currents(free) = min(max(moved, form.lower(free)), form.upper(free));
        if meets > 0
            currents(free(meets)) = bound;
            free(meets) = [];
            continue
        end
        slope = form.matrix * currents - form.linear + price;
        bulk = abs(form.matrix) * abs(currents) + abs(form.linear) + price;
        pull = abs(slope) .* ((slope < 0 & currents < form.upper) | (slope > 0 & currents > form.lower));
        pull(pull <= 1e-13 * bulk) = 0;
        pull(free) = 0;
        [most, worst] = max(pull);
        if most == 0
            break
        end
        free(end + 1) = worst;
    end
end

% Currents of least power for a force vector: the algorithm of src/lambda/vector_allocation.rs.

function [currents, met] = allocate_vector(per_ampere, wanted, r, lower, upper, total, sideways_weight)
% The currents that give the vector for the forces per ampere, [coil, axis], or the nearest force,
% sideways errors times the weight; and whether they do.
    largest = max(abs(per_ampere(:)));
    currents = zeros(size(r));
    met = ~any(wanted);
    if met || ~all(isfinite(wanted)) || largest == 0 || isinf(1 / largest)
        return
    end
    weights = [sideways_weight, sideways_weight, 1];
    d.rows = [per_ampere .* weights * (1 / largest), ones(numel(r), 1)];
    d.target = [wanted .* weights * (1 / largest), total].';
    d.conductance = (min(r) ./ r).';
    d.lower = lower.';
    d.upper = upper.';
    d.at = zeros(numel(r), 1);
    d.currents = zeros(numel(r), 1);
    [d, met, proven] = solve_dual(d);
    currents = d.currents.';
    if proven
        return
    end
    % In coordinates in which the coils without limits give alike in every direction.
    product = (d.rows(:, 1:3).' .* d.conductance.') * d.rows(:, 1:3);
    product(1:4:9) = product(1:4:9) + (product(1:4:9) == 0);
    [scale, factor] = factored(product, 1e-13);
    if isempty(scale)
        return
    end
    d.rows(:, 1:3) = forward(scale, factor, d.rows(:, 1:3).').';
    d.target(1:3) = forward(scale, factor, d.target(1:3));
    [d, given, proven] = solve_dual(d);
    if given && proven
        currents = d.currents.';
        met = true;
    end
end

function [d, met, proven] = solve_dual(d)
% Leaves the currents; whether they give the force, and whether that is proven.
    size_of_force = sum(d.conductance .* sum(d.rows(:, 1:3) .^ 2, 2));
    most = sum(sqrt(sum(d.rows(:, 1:3) .^ 2, 2)) .* max(d.upper, -d.lower));
    % The multipliers grow with the force beyond reach; the sum's limit holds all the same.
    within_reach = min(most / norm(d.target(1:3)), 1);
    of_sum = 1e-6 * within_reach * sum(d.conductance);
    proven = true;
    y = zeros(4, 1);
    share = 1e-7;
    while true
        d.eps = share * [size_of_force; size_of_force; size_of_force; of_sum];
        n = 3;
        y(4) = 0;
        [d, y] = climb(d, y, n);
        if sum(d.currents) > d.target(4)
            n = 4;
            [d, y] = climb(d, y, n);
        end
        [d, met] = finish_exactly(d, y, n);
        if met
            return
        end
        [d, nearest] = finish_nearest(d, n);
        if ~nearest && share * 1e-3 >= 1e-14
            share = share * 1e-3;
            continue
        end
        if ~nearest
            proven = false;
            d.currents = min(max(d.conductance .* (d.rows(:, 1:n) * y(1:n)), d.lower), d.upper);
            above = d.currents - d.lower;
            if sum(d.currents) > d.target(4)
                d.currents = d.lower + above * (d.target(4) - sum(d.lower)) / sum(above);
            end
        end
        met = vector_met(d);
        return
    end
end

function [d, slope, curvature, changed] = dual_place(d, y, n, all_free)
% Currents, slope and curvature of the dual at y, and whether another coil is at a limit than before.
    alone = d.conductance .* (d.rows(:, 1:n) * y(1:n));
    at = (alone >= d.upper) - (alone <= d.lower);
    at(alone <= d.lower) = -1;
    if all_free
        at(:) = 0;
    end
    d.currents = alone;
    d.currents(at < 0) = d.lower(at < 0);
    d.currents(at > 0) = d.upper(at > 0);
    changed = all_free || any(at ~= d.at);
    d.at = at;
    free = d.rows(at == 0, 1:n);
    slope = d.target(1:n) - d.eps(1:n) .* y(1:n) - d.rows(:, 1:n).' * d.currents;
    curvature = diag(d.eps(1:n)) + free.' * (d.conductance(at == 0, 1) .* free);
end

function [d, y] = climb(d, y, n)
% Newton's steps to the top of the dual.
    [d, slope, curvature] = dual_place(d, y, n, ~any(y(1:n)));
    for turn = 1:60
        step = cholesky(curvature, slope, 0);
        uphill = sum(step .* slope(1:numel(step)));
        if isempty(step) || ~(uphill > 0 && isfinite(uphill))
            break
        end
        there = y;
        there(1:n) = y(1:n) + step;
        [d, next_slope, next_curvature, changed] = dual_place(d, there, n, false);
        if abs(sum(step .* next_slope)) <= 0.1 * uphill
            y = there;
            slope = next_slope;
            curvature = next_curvature;
            if ~changed
                break
            end
            continue
        end
        y(1:n) = y(1:n) + top_along(d, y, step, n) * step;
        [d, slope, curvature] = dual_place(d, y, n, false);
    end
end

function length = top_along(d, y, step, n)
% Where the dual is highest along a step: its slope falls piecewise linearly.
    alone = d.conductance .* (d.rows(:, 1:n) * y(1:n));
    per_step = d.rows(:, 1:n) * step;
    speed = d.conductance .* per_step;
    slope = sum(step .* (d.target(1:n) - d.eps(1:n) .* y(1:n)));
    slope = slope - sum(per_step .* min(max(alone, d.lower), d.upper));
    fall = sum(d.eps(1:n) .* step .^ 2);
    near = d.lower;
    near(speed < 0) = d.upper(speed < 0);
    far = d.upper;
    far(speed < 0) = d.lower(speed < 0);
    leaves = (near - alone) ./ speed;
    meets = (far - alone) ./ speed;
    bend = speed .* per_step;
    use = speed ~= 0 & meets > 0;
    fall = fall + sum(bend(use & leaves <= 0));
    later = use & leaves > 0;
    kinks = sortrows([leaves(later), bend(later); meets(use), -bend(use)]);
    since = 0;
    for k = 1:size(kinks, 1)
        to = kinks(k, 1);
        if slope <= fall * (to - since)
            break
        end
        slope = slope - fall * (to - since);
        fall = fall + kinks(k, 2);
        since = to;
    end
    length = since;
    if fall > 0
        length = since + slope / fall;
    end
end

function [left, size_of_terms] = missing_force(d)
% What is missing of force and sum, and the size of the force's terms.
    sizes = sqrt(sum(d.rows(:, 1:3) .^ 2, 2)) .* abs(d.currents);
    left = d.target - d.rows.' * d.currents;
    size_of_terms = norm(d.target(1:3)) + sum(sizes);
end

function met = vector_met(d)
    [left, size_of_terms] = missing_force(d);
    met = norm(left(1:3)) <= 1e-11 * size_of_terms;
end

function [d, optimal] = finish_exactly(d, climbed, n)
% Solves the free currents without eps; whether that is optimal.
    optimal = false;
    free = d.at == 0;
    rows = d.rows(free, 1:n);
    system = rows.' * (d.conductance(free, 1) .* rows);
    right = d.target(1:n) - d.rows(~free, 1:n).' * d.currents(~free, 1);
    y = climbed;
    for turn = 1:3
        step = cholesky(system + diag(d.eps(1:n)), right - system * y(1:n), 0);
        if isempty(step)
            return
        end
        y(1:n) = y(1:n) + step;
    end
    size_of_y = sum(abs(y));
    if n == 4 && y(4) > 1e-11 * size_of_y
        return
    end
    alone = d.conductance .* (d.rows(:, 1:n) * y(1:n));
    slack = 1e-11 * max(d.conductance * size_of_y, d.upper - d.lower);
    low = alone >= d.lower - slack;
    high = alone <= d.upper + slack;
    at_lower = d.at < 0;
    at_upper = d.at > 0;
    if ~all(low(free) & high(free)) || ~all(alone(at_lower) <= d.lower(at_lower) + slack(at_lower)) || ...
       ~all(alone(at_upper) >= d.upper(at_upper) - slack(at_upper))
        return
    end
    clipped = min(max(alone, d.lower), d.upper);
    d.currents(free) = clipped(free);
    terms = sum(abs(d.currents));
    optimal = vector_met(d) && sum(d.currents) <= d.target(4) + 1e-11 * terms;
end

function [d, nearest] = finish_nearest(d, n)
% Solves the free currents for the nearest force, of several by the least power; whether it is. Where the sum binds
% they share what the others leave of it, and a coil counts by how much its force differs from their mean.
    nearest = false;
    free = d.at == 0;
    d.currents(free) = 0;
    left = missing_force(d);
    conductance = d.conductance(free, 1);
    more = d.rows(free, 1:3);
    least = 1e-6 * max([sqrt(conductance) .* sqrt(sum(more .^ 2, 2)); 0]);
    shared = zeros(nnz(free), 1);
    if n == 4 && any(free)
        middle = sum(more .* conductance, 1) / sum(conductance);
        more = more - middle;
        shared = left(4) * conductance / sum(conductance);
        left(1:3) = left(1:3) - middle.' * left(4);
    end
    axes = spanned(more .* sqrt(conductance), least);
    y = zeros(3, 1);
    if ~isempty(axes)
        along = more * axes;
        solved = cholesky(along.' * (along .* conductance), axes.' * left(1:3), 1e-13);
        if isempty(solved)
            return
        end
        y = axes * solved;
    end
    found = shared + conductance .* (more * y);
    [low, high] = deal(d.lower(free, 1), d.upper(free, 1));
    slack = 1e-11 * (high - low);
    if ~all(found >= low - slack & found <= high + slack)
        return
    end
    d.currents(free) = min(max(found, low), high);
    nearest = is_nearest(d, n);
end

function axes = spanned(forces, least)
% Orthonormal axes, [component, axis], of the space that forces span, the longest first; none for what is no longer
% than `least`.
    axes = zeros(3, 0);
    while size(axes, 2) < 3
        rest = forces - (forces * axes) * axes.';
        [longest, at] = max(sqrt(sum(rest .^ 2, 2)));
        if isempty(longest) || ~(longest > least)
            return
        end
        axes(:, end + 1) = rest(at, :).' / longest; %#ok<AGROW>
    end
end

function nearest = is_nearest(d, n)
% Whether what is missing pulls every coil against the limit it is at, the sum's included.
    nearest = false;
    [left, size_of_terms] = missing_force(d);
    missing = norm(left(1:3));
    if missing <= 1e-11 * size_of_terms
        return
    end
    slack = 1e-9 * missing + 1e-14 * size_of_terms;
    pull = d.rows(:, 1:3) * left(1:3);
    if n == 4
        price = max([pull(d.at == 0); -Inf]);
        if price < -slack
            return
        end
        pull = pull - price;
    elseif sum(d.currents) > d.target(4) * (1 + 1e-11)
        return
    end
    nearest = all(abs(pull(d.at == 0)) <= slack) && all(d.at .* pull >= -slack | d.at == 0);
end

function x = cholesky(matrix, right, least)
% Solves a symmetric positive definite system; empty where a pivot is at most `least` of its entry.
    x = [];
    [scale, factor] = factored(matrix, least);
    if isempty(scale)
        return
    end
    x = forward(scale, factor, right);
    n = numel(scale);
    for a = n:-1:1
        x(a) = (x(a) - sum(factor(a + 1:n, a) .* x(a + 1:n, 1))) / factor(a, a);
    end
    x = x ./ scale;
end

function [scale, factor] = factored(matrix, least)
% S and L of a symmetric positive definite matrix S L L' S; empty as cholesky.
    factor = [];
    scale = sqrt(diag(matrix));
    if ~isreal(scale) || ~all(scale > 0 & isfinite(scale))
        scale = [];
        return
    end
    n = numel(scale);
    scaled = matrix ./ (scale * scale.');
    factor = zeros(n);
    for a = 1:n
        for b = 1:a
            value = scaled(a, b) - sum(factor(a, 1:b - 1) .* factor(b, 1:b - 1));
            if a ~= b
                factor(a, b) = value / factor(b, b);
            elseif ~(value > least)
                scale = [];
                return
            else
                factor(a, a) = sqrt(value);
            end
        end
    end
end

function x = forward(scale, factor, right)
% (S L)^-1 times columns.
    x = right ./ scale;
    for a = 1:numel(scale)
        x(a, :) = (x(a, :) - factor(a, 1:a - 1) * x(1:a - 1, :)) / factor(a, a);
    end
end

% Currents of least power: I_i = clip((mu (g_i - center) + nu) / R_i). The algorithm is told in
% src/lambda/allocation.rs; here it is written for clearness, not for speed.

function [best, met] = allocate(per_ampere, wanted, r, lower, upper, total)
% The currents of least power that give `wanted` N, or the nearest force, and whether they do.
    rounding = 1e-14;
    tied = 1e-13;
    scale = max(abs(per_ampere));
    if wanted == 0 || isnan(wanted) || scale == 0 || isinf(1 / scale)
        best = zeros(size(r));
        met = wanted == 0;
        return
    end
    if wanted < 0
        scale = -scale;
    end
    row = per_ampere / scale;
    row(abs(row) < 1e-60) = 0;
    target = wanted / scale;
    clip = @(values) min(max(values, lower), upper);
    met = true;
    mu = multiplier(row, target, r, lower, upper);
    if ~isempty(mu)
        best = clip(mu * row ./ r);
        if sum(best) <= total
            return
        end
    end
    largest = largest_force(row, r, lower, upper, total, tied);
    best = largest;
    most = sum(row .* largest);
    if target >= most * (1 - rounding)
        met = target <= most * (1 + rounding);
        return
    end
    low = 0;
    high = Inf;
    sigma = 0;
    least = Inf;
    use = find(row);
    for step = 0:119
        % The piece of mu on which the force is met for this sigma.
        breaks = sort([(lower(use) .* r(use) + sigma) ./ row(use), (upper(use) .* r(use) + sigma) ./ row(use)]);
        forces = arrayfun(@(at) sum(row .* clip((at * row - sigma) ./ r)), breaks);
        above = [find(forces >= target, 1), numel(breaks) + 1];
        to = breaks(min(above(1), numel(breaks)));
        since = breaks(max(min(above(1), numel(breaks) + 1) - 1, 1));
        ends = [since; to] * row - sigma;
        least_end = min(ends, [], 1);
        most_end = max(ends, [], 1);
        % Up to the rounding at an end, not at the other, which may lie at 1e30.
        moves = lower < upper & least_end >= lower .* r - 4 * eps * (sigma + abs(least_end)) & ...
                most_end <= upper .* r + 4 * eps * (sigma + abs(most_end));
        slope = sum(row(moves) .^ 2 ./ r(moves));
        mu = to;
        if slope > 0
            % A far end would take the digits: then from the piece's point nearest to nothing.
            near = min(max(0, since), to);
            at = to;
            if abs(to) > 1e3 * max(sigma, abs(near))
                at = near;
            end
            mu = min(max(at + (target - sum(row .* clip((at * row - sigma) ./ r))) / slope, since), to);
        end
        % Both rows met if those coils are the ones that move.
        center = 0;
        nu = -sigma;
        jump = mu;
        if any(moves)
            rest = clip((0.5 * (since + to) * row - sigma) ./ r);
            rest = rest(~moves);
            weight = sum(1 ./ r(moves));
            center = sum(row(moves) ./ r(moves)) / weight;
            force = target - sum(row(~moves) .* rest);
            share = total - sum(rest);
            offset = sum((row(moves) - center) ./ r(moves)) / weight;
            spread = sum((row(moves) - center - offset) .^ 2 ./ r(moves));
            jump = 0;
            if spread > tied ^ 2 * weight
                jump = (force - (center + offset) * share) / spread;
            end
            nu = share / weight - jump * offset;
        end
        currents = clip((jump * (row - center) + nu) ./ r);
        fault = abs(sum(row .* currents) - target) / (sum(abs(row .* currents)) + target);
        size_a = sum(abs(currents)) + total;
        if size_a > 0
            fault = max(fault, abs(sum(currents) - total) / size_a);
        end
        next = jump * center - nu;
        if fault < least && next >= 0
            least = fault;
            best = currents;
        end
        if least <= rounding
            break
        end
        excess = sum(clip((mu * row - sigma) ./ r)) - total;
        if excess > 0
            low = sigma;
        else
            high = sigma;
        end
        if low < next && next < high && mod(step, 3) ~= 2
            sigma = next;
        elseif isinf(high)
            sigma = max(4 * low, excess / sum(1 ./ r));
        elseif 0 < low && high > 4 * low
            sigma = sqrt(low * high);
        else
            sigma = 0.5 * (low + high);
        end
        if ~(low < sigma && sigma < high)
            break
        end
    end
    if least > 1 - target / most
        best = largest;
    end
end

function mu = multiplier(row, target, r, lower, upper)
% Where sum(row .* clip(mu * row ./ r)) is target > 0; empty where it cannot be.
    mu = [];
    use = find(row);
    bound = lower(use);
    up = row(use) > 0;
    bound(up) = upper(use(up));
    [leaves, order] = sort(bound .* r(use) ./ row(use));
    use = use(order);
    tail = fliplr(cumsum(fliplr(row(use) .^ 2 ./ r(use))));
    held = [0, cumsum(row(use) .* bound(order))];
    at = find(held(1:end - 1) + leaves .* tail >= target, 1);
    if ~isempty(at)
        mu = (target - held(at)) / tail(at);
    elseif ~isempty(use) && held(end) >= target
        mu = leaves(end);
    end
end

function currents = largest_force(row, r, lower, upper, total, tied)
% The currents of the largest force, those of least power among them.
    currents = lower;
    [~, order] = sort(-row);
    start = 1;
    while start <= numel(row) && row(order(start)) >= -tied
        gain = row(order(start));
        rest = order(start:end);
        group = rest(row(rest) >= gain - tied);
        % What the sum allows this group. Its own lower limits are left out of account: one of 1e30 A
        % would take every digit of a limit of 1 A.
        share = total - sum(upper(order(1:start - 1))) - sum(lower(order(start + numel(group):end)));
        if sum(upper(group)) <= share && gain > tied
            currents(group) = upper(group);
            start = start + numel(group);
            continue
        end
        if gain <= tied
            share = min(share, 0);
        end
        ones_of = zeros(size(row));
        ones_of(group) = 1 - 2 * (share < 0);
        mu = 0;
        if share ~= 0
            mu = multiplier(ones_of, abs(share), r, lower, upper);
            if isempty(mu)
                mu = 1e300;
            end
        end
        currents(group) = min(max(mu * ones_of(group) ./ r(group), lower(group)), upper(group));
        return
    end
end

function manifest = read_manifest(folder)
    path = fullfile(folder, 'manifest.json');
    if ~exist(path, 'file')
        error('fluxform:bundle', '%s is not a bundle: it has no manifest.json', folder);
    end
    manifest = decoded(text_of(path, 2 ^ 26), path);
    if ~strncmp(manifest.schema_version, '1.', 2)
        error('fluxform:bundle', '%s: schema_version %s, this loader reads 1.x', path, ...
              manifest.schema_version);
    end
    told = {manifest.map};
    if isfield(manifest.map, 'passive_force') && isstruct(manifest.map.passive_force)
        told{2} = manifest.map.passive_force;
    end
    for k = 1:numel(told)
        if ~strcmp(told{k}.interpolation.name, 'tricubic-lagrange')
            error('fluxform:bundle', 'interpolation %s, this loader implements tricubic-lagrange', ...
                  told{k}.interpolation.name);
        end
    end
end

function files = read_files(folder, known)
% The bytes of the files that are needed, after checking place, size and digest of every listed one.
    names = {known.path};
    if numel(unique(names)) < numel(names)
        error('fluxform:bundle', 'manifest.json lists a file twice');
    end
    files = struct();
    needed = {'map.npz', 'points.csv', 'currents.csv', 'lambda.json'};
    paths = cell(size(names));
    for k = 1:numel(known)
        name = known(k).path;
        parts = strsplit(name, '/', 'CollapseDelimiters', false);
        if any(ismember(parts, {'', '.', '..'})) || any(name == '\') || any(name < ' ')
            error('fluxform:bundle', 'manifest.json lists %s, which leads out of the bundle', name);
        end
        path = folder;
        for part = 1:numel(parts)
            path = fullfile(path, parts{part});
            if is_link(path)
                error('fluxform:bundle', 'manifest.json lists %s, which is a link', name);
            end
        end
        most = 2 ^ 28;                            % of what is only hashed
        if any(strcmp(name, needed))
            most = 2 ^ 32;
        end
        check_plain(path, min(known(k).bytes, most));
        paths{k} = path;
    end
    for k = 1:numel(known)                        % all sizes before any content
        name = known(k).path;
        path = paths{k};
        text = text_of(path, known(k).bytes);
        if numel(text) ~= known(k).bytes
            error('fluxform:bundle', '%s was changed or damaged: its size differs', path);
        end
        digest = sha256(text);
        if ~isempty(digest) && ~strcmp(digest, known(k).sha256)
            error('fluxform:bundle', '%s was changed or damaged: its SHA-256 differs', path);
        end
        if any(strcmp(name, needed))
            files.(strrep(name, '.', '_')) = text;
        end
    end
    if numel(fieldnames(files)) < 4
        error('fluxform:bundle', 'manifest.json must list map.npz, points.csv, currents.csv and lambda.json');
    end
end

function check_plain(path, most_bytes)
% Looks at a file without opening it: opening a pipe would wait for its other end. A file of holes
% takes far more memory than it took to make.
    found = dir(path);
    plain = numel(found) == 1 && ~found.isdir;
    holes = false;
    if plain && exist('OCTAVE_VERSION', 'builtin')
        [status, failed] = stat(path);
        plain = failed == 0 && S_ISREG(status.mode);
        holes = plain && found.bytes > 2 ^ 24 && found.bytes > 64 * 512 * status.blocks;
    end
    if ~plain
        error('fluxform:bundle', '%s is missing or not a plain file', path);
    end
    if found.bytes > most_bytes || holes
        error('fluxform:bundle', '%s was changed or damaged: its size differs, or it is too large or full of holes', path);
    end
end

function text = text_of(path, most_bytes)
% The bytes of a plain file, at most so many.
    check_plain(path, most_bytes);
    file = fopen(path, 'r');
    if file < 0
        error('fluxform:bundle', 'cannot read %s', path);
    end
    text = fread(file, [1, most_bytes], 'uint8=>char');
    fclose(file);
end

function yes = is_link(path)
% Octave tells; MATLAB has no way to ask that all its versions know.
    yes = false;
    if exist('OCTAVE_VERSION', 'builtin')
        [status, failed] = lstat(path);
        yes = failed == 0 && S_ISLNK(status.mode);
    end
end

function value = decoded(text, name)
% JSON that nests no deeper than ours: the reader would run out of its stack.
    depth = cumsum((text == '[') + (text == '{') - (text == ']') - (text == '}'));
    if any(depth > 64)
        error('fluxform:bundle', '%s nests too deep', name);
    end
    value = jsondecode(text);
end

function digest = sha256(text)
    if exist('OCTAVE_VERSION', 'builtin')
        digest = hash('sha256', text);
    elseif usejava('jvm')
        engine = java.security.MessageDigest.getInstance('SHA-256');
        digest = sprintf('%02x', typecast(engine.digest(uint8(text)), 'uint8'));
    else
        digest = '';
    end
end

function columns = columns_of(text, name)
% A table of numbers: its columns by the names in its first line.
    lines = regexp(text, '[^\r\n]+', 'match');
    names = strsplit(lines{1}, ',');
    numbers = sscanf(strrep(strjoin(lines(2:end), ' '), ',', ' '), '%f');
    if mod(numel(numbers), numel(names)) ~= 0 || numel(numbers) ~= numel(names) * (numel(lines) - 1)
        error('fluxform:bundle', '%s is not a table of numbers', name);
    end
    if ~all(isfinite(numbers))
        error('fluxform:bundle', '%s holds a number that is not finite', name);
    end
    numbers = reshape(numbers, numel(names), []).';
    for k = 1:numel(names)
        columns.(names{k}) = numbers(:, k);
    end
end

function map = read_npz(path)
% The arrays that are needed of an uncompressed zip of .npy files, by name.
    names = {'x_m', 'y_m', 'z_m', 'coil', 'gz_t_per_m_per_a', 'moment_a_m2', 'current_min_a', ...
             'current_max_a', 'resistance_ohm', 'gradient_t_per_m_per_a', 'field_t_per_a', 'passive_force_n', ...
             'working_point_gz_t_per_m', 'total_current_max_a', 'lambda_n_per_m', 'height_x_m', 'height_y_m', ...
             'height_m', 'has_height', 'static_current_a', 'inductance_h', 'voltage_v', 'schema_version', ...
             'gx_t_per_m_per_a', 'gy_t_per_m_per_a', 'requested_direction', 'sideways_weight', ...
             'robust_setting'};
    file = fopen(path, 'r', 'ieee-le');
    closing = onCleanup(@() fclose(file));
    fseek(file, 0, 'eof');
    length_bytes = ftell(file);
    % The one form that all loaders accept, see _entries in load_bundle.py.
    fseek(file, -22, 'eof');
    last = fread(file, 22, 'uint8=>double').';
    tail = @(at, bytes) sum(last(at + (1:bytes)) .* 256 .^ (0:bytes - 1));
    if numel(last) ~= 22 || tail(0, 4) ~= hex2dec('06054b50') || tail(20, 2) ~= 0
        error('fluxform:bundle', '%s is not a zip file without a comment', path);
    end
    count = tail(10, 2);
    directory = tail(16, 4);
    if tail(4, 4) ~= 0 || tail(8, 2) ~= count || count > 64 || directory + tail(12, 4) ~= length_bytes - 22
        error('fluxform:bundle', '%s: its directory is damaged or too long', path);
    end
    entry = directory;
    seen = {};
    map = struct();
    for k = 1:count
        fseek(file, entry, 'bof');
        head = fread(file, 46, 'uint8=>double');
        if numel(head) ~= 46 || ~isequal(head(1:4).', [80, 75, 1, 2])
            error('fluxform:bundle', '%s: its directory is damaged', path);
        end
        number = @(at, bytes) sum(head(at + (1:bytes)).' .* 256 .^ (0:bytes - 1));
        lengths = [number(28, 2), number(30, 2), number(32, 2)];
        name = fread(file, [1, lengths(1)], 'uint8=>char');
        entry = entry + 46 + sum(lengths);
        size_bytes = number(24, 4);
        if entry > length_bytes - 22 || number(42, 4) + 30 > directory
            error('fluxform:bundle', '%s: its directory is damaged', path);
        end
        if number(10, 2) ~= 0 || mod(number(8, 2), 2) ~= 0 || number(20, 4) ~= size_bytes
            error('fluxform:bundle', '%s: %s is not stored as it is', path, name);
        end
        if any(strcmp(seen, name))
            error('fluxform:bundle', '%s: %s stands there twice', path, name);
        end
        seen{end + 1} = name;
        local = number(42, 4);
        fseek(file, local, 'bof');
        mark = fread(file, [1, 4], 'uint8=>double');
        fseek(file, local + 26, 'bof');
        skip = fread(file, 2, 'uint16');
        if ~isequal(mark, [80, 75, 3, 4]) || local + 30 + sum(skip) + size_bytes > directory
            error('fluxform:bundle', '%s: %s lies outside the file', path, name);
        end
        if ~isequal(fread(file, [1, skip(1)], 'uint8=>char'), name)
            error('fluxform:bundle', '%s: %s has another name in the directory', path, name);
        end
        key = regexprep(name, '\.npy$', '');
        if ~any(strcmp(key, names)) || strcmp(key, name)
            continue
        end
        fseek(file, local + 30 + sum(skip), 'bof');
        kinds = {'f8', 'i8'};
        kind = kinds{1 + any(strcmp(key, {'coil', 'schema_version'}))};
        map.(key) = read_npy(file, size_bytes, name, kind);
    end
    if entry ~= length_bytes - 22
        error('fluxform:bundle', '%s: its directory is damaged', path);
    end
    missing = names(1:9);
    missing = missing(~isfield(map, missing));
    if ~isempty(missing)
        error('fluxform:bundle', '%s: array %s is missing', path, missing{1});
    end
end

function values = read_npy(file, bytes, name, kind)
% One array in C order as an array of the same indices, or a row where it has one dimension.
    magic = fread(file, 8, 'uint8=>double').';
    if ~isequal(magic, [147, double('NUMPY'), 1, 0])
        error('fluxform:bundle', '%s is not an NPY 1.0 array', name);
    end
    header_bytes = fread(file, 1, 'uint16');
    header = fread(file, [1, header_bytes], 'uint8=>char');
    if ~isempty(header) && header(end) == char(10)
        header(end) = [];
    end
    found = regexp(header(header ~= ' '), ['^\{''descr'':''<(f8|i8)'',''fortran_order'':False,' ...
                                           '''shape'':\(((?:\d+,)*\d*)\),?\}$'], 'tokens', 'once');
    if any(header < ' ') || ~isempty(regexp(header, '\d +\d', 'once'))
        found = {};                               % spaces are the only blanks, and part no number
    end
    if isempty(found) || ~strcmp(found{1}, kind)
        error('fluxform:bundle', '%s must hold numbers of kind %s in C order', name, kind);
    end
    shape = sscanf(strrep(found{2}, ',', ' '), '%d').';
    if 8 * prod(shape) ~= bytes - 10 - header_bytes
        error('fluxform:bundle', '%s has not the size that its header tells', name);
    end
    if strcmp(found{1}, 'f8')
        values = fread(file, [1, prod(shape)], 'double=>double');
    else
        values = fread(file, [1, prod(shape)], 'int64=>double');
    end
    if ~all(abs(values) <= 1e30)
        error('fluxform:bundle', '%s holds a number that is not finite or beyond 1e30', name);
    end
    if numel(shape) > 1
        values = permute(reshape(values, fliplr(shape)), numel(shape):-1:1);
    end
end

function check(map, bundle)
% Whether the arrays fit each other.
    if numel(map.schema_version) ~= 3 || map.schema_version(1) ~= 1
        error('fluxform:bundle', 'map.npz: schema_version is not one that this loader reads');
    end
    stated = bundle.manifest.lambda.lambda_n_per_m;
    own = bundle.lambda_n_per_m;
    if numel(stated) ~= numel(own) || any(abs(own - stated) > 1e-12 * abs(own))
        error('fluxform:bundle', 'map.npz and manifest.json state different lambda_n_per_m');
    end
    coils = numel(map.current_max_a);
    if numel(bundle.currents_a) ~= coils
        error('fluxform:bundle', 'currents.csv must have one row a coil');
    end
    if any(map.coil < 0) || any(map.coil >= coils) || any(diff(map.coil) <= 0)
        error('fluxform:bundle', 'map.npz: coil must hold increasing indices of coils');
    end
    names = {'x_m', 'y_m', 'z_m'};
    surface = [0, 0];
    if isfield(map, 'height_m')
        names = [names, {'height_x_m', 'height_y_m'}];
        surface = [numel(map.height_y_m), numel(map.height_x_m)];
    end
    for k = 1:numel(names)
        nodes = map.(names{k});
        if isempty(nodes) || size(nodes, 1) > 1 || any(diff(nodes) < 1e-15) || any(abs(nodes) > 1e6)
            error('fluxform:bundle', 'map.npz: %s must increase from node to node', names{k});
        end
    end
    grid = [numel(map.z_m), numel(map.y_m), numel(map.x_m)];
    wanted = {'gz_t_per_m_per_a', [numel(map.coil), grid]; 'gx_t_per_m_per_a', [numel(map.coil), grid]; ...
              'gy_t_per_m_per_a', [numel(map.coil), grid]; 'requested_direction', [surface, 3]; ...
              'sideways_weight', [1, 1]; 'robust_setting', [1, 5]; ...
              'gradient_t_per_m_per_a', [numel(map.coil), grid, 3, 3]; ...
              'passive_force_n', grid; 'moment_a_m2', [1, 3]; 'current_max_a', [1, coils]; ...
              'current_min_a', [1, coils]; 'resistance_ohm', [1, coils]; 'lambda_n_per_m', [1, 1]; ...
              'total_current_max_a', [1, 1]; 'height_m', surface; 'has_height', surface; ...
              'static_current_a', [1, coils]; 'inductance_h', [coils, coils]; 'voltage_v', [1, 1]; ...
              'field_t_per_a', [numel(map.coil), grid, 3]; 'working_point_gz_t_per_m', grid};
    for k = 1:size(wanted, 1)
        if isfield(map, wanted{k, 1})
            found = map.(wanted{k, 1});
            shape = arrayfun(@(d) size(found, d), 1:numel(wanted{k, 2}));
            if ~isequal(shape, wanted{k, 2}) || numel(found) ~= prod(shape)
                error('fluxform:bundle', 'map.npz: %s has the wrong shape', wanted{k, 1});
            end
        end
    end
    if any(map.moment_a_m2(1:2)) && ~isfield(map, 'gradient_t_per_m_per_a')
        error('fluxform:bundle', 'a tilted magnet needs gradient_t_per_m_per_a in map.npz');
    end
    if isfield(map, 'gx_t_per_m_per_a') ~= isfield(map, 'gy_t_per_m_per_a')
        error('fluxform:bundle', 'map.npz: gx_t_per_m_per_a and gy_t_per_m_per_a belong together');
    end
    if isfield(map, 'requested_direction') && ~(isfield(map, 'gx_t_per_m_per_a') && isfield(map, 'height_m') && ...
       isfield(map, 'sideways_weight') && map.sideways_weight >= 1e-6 && map.sideways_weight <= 1)
        error('fluxform:bundle', 'map.npz: requested_direction needs gx_t_per_m_per_a and a sideways_weight of 1e-6 to 1');
    end
    if isfield(map, 'robust_setting') && (any(map.robust_setting < 0) || map.robust_setting(1) == 0)
        error('fluxform:bundle', 'map.npz: robust_setting must hold a price above 0 and nothing below 0');
    end
    if isfield(map, 'height_m')
        if ~all(isfield(map, {'static_current_a', 'inductance_h'}))
            error('fluxform:bundle', 'map.npz: height_m needs static_current_a and inductance_h');
        end
        if ~isfield(map, 'has_height') || ~all(map.has_height(:) == 0 | map.has_height(:) == 1)
            error('fluxform:bundle', 'map.npz: has_height must hold 0 or 1');
        end
        if ~all(map.resistance_ohm >= 1e-30)
            error('fluxform:bundle', 'map.npz: resistance_ohm must be above 0');
        end
        if any(map.current_min_a > 0) || any(map.current_max_a < 0) || ...
           (isfield(map, 'total_current_max_a') && map.total_current_max_a < 0)
            error('fluxform:bundle', 'map.npz: current_max_a: limits must enclose 0');
        end
    end
end
