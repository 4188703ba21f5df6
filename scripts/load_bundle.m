function bundle = load_bundle(folder)
% LOAD_BUNDLE  Load a fluxform bundle: GNU Octave 7, or MATLAB R2016b and newer; no toolbox.
%
%   addpath scripts
%   bundle = load_bundle('results/seed/flat');
%   force = bundle.force_per_ampere([0.01, 0, 0.05]);   % N/A, one row a point, one column a coil
%   total = force * bundle.currents_a;                  % N
%   total = total + bundle.passive_force([0.01, 0, 0.05]);   % N, the unpowered steel's pull
%   h = bundle.height([0.01, 0]);                       % m, NaN where there is no surface
%
% Fields: manifest and lambda (manifest.json, lambda.json), points (the columns of points.csv by
% name), currents_a (one row a coil), lambda_n_per_m (empty if none), map: the arrays of map.npz,
% gz_t_per_m_per_a as [coil, z, y, x]. Coils are numbered from 0 as everywhere, so coil k is row
% or column k + 1. Points are rows of x, y, z in m. What lies outside the map has no force.
%
% Sizes are checked, and SHA-256 digests where there is a way to compute them (Octave, or MATLAB
% with Java). JSON may lose the last digit of a number; map.npz and the tables do not.

    bundle.manifest = read_manifest(folder);
    known = bundle.manifest.files;
    bundle.lambda = jsondecode(listed(folder, known, 'lambda.json'));
    bundle.points = columns_of(listed(folder, known, 'points.csv'), 'points.csv');
    currents = columns_of(listed(folder, known, 'currents.csv'), 'currents.csv');
    bundle.currents_a = currents.current_a;
    listed(folder, known, 'map.npz');
    map = read_npz(fullfile(folder, 'map.npz'));
    check(map, bundle);
    bundle.map = map;
    bundle.lambda_n_per_m = [];
    if isfield(map, 'lambda_n_per_m')
        bundle.lambda_n_per_m = map.lambda_n_per_m;
    end
    bundle.force_per_ampere = @(points_m) force_per_ampere(map, points_m);
    bundle.passive_force = @(points_m) passive_force(map, points_m);
    bundle.height = @(points_m) height(map, points_m);
end

function force = force_per_ampere(map, points_m)
% Upward force on the magnet's centre, N/A: the sum over i of m_i dB_i/dz.
    m = map.moment_a_m2;
    force = zeros(size(points_m, 1), numel(map.current_max_a));
    if m(1) == 0 && m(2) == 0
        found = m(3) * interpolate(map, map.gz_t_per_m_per_a, points_m);
    else
        found = 0;
        for i = 1:3
            part = map.gradient_t_per_m_per_a(:, :, :, :, i, 3);
            found = found + m(i) * interpolate(map, part, points_m);
        end
    end
    force(:, map.coil + 1) = found.';
end

function force = passive_force(map, points_m)
% What the unpowered steel adds to the force, N, up positive; zero for bundles without it.
    force = zeros(size(points_m, 1), 1);
    if isfield(map, 'passive_force_n')
        values = reshape(map.passive_force_n, [1, size(map.passive_force_n)]);
        force(:) = interpolate(map, values, points_m);
    end
end

function found = interpolate(map, values, points_m)
% Values [map, z, y, x] at points: tricubic Lagrange, one row a map, one column a point; 0 outside.
    found = zeros(size(values, 1), size(points_m, 1));
    for p = 1:size(points_m, 1)
        [ix, wx] = stencil(map.x_m, points_m(p, 1));
        [iy, wy] = stencil(map.y_m, points_m(p, 2));
        [iz, wz] = stencil(map.z_m, points_m(p, 3));
        if isempty(ix) || isempty(iy) || isempty(iz)
            continue
        end
        near = values(:, iz, iy, ix);
        found(:, p) = reshape(near, size(values, 1), []) * kron(wx, kron(wy, wz)).';
    end
end

function [index, weight] = stencil(nodes, position)
% The nodes of an axis that take part at a position, and their weights; none outside.
    index = [];
    weight = [];
    if ~(nodes(1) <= position && position <= nodes(end))
        return
    end
    count = min(4, numel(nodes));
    above = sum(nodes <= position);
    start = min(max(above - 2, 0), numel(nodes) - count);
    index = start + (1:count);
    near = nodes(index);
    weight = ones(1, count);
    for k = 1:count
        others = near([1:k - 1, k + 1:count]);
        weight(k) = prod(position - others) / prod(near(k) - others);
    end
end

function found = height(map, points_m)
% The surface's height, m, bilinear between the bundle's points; NaN where there is none.
    found = NaN(size(points_m, 1), 1);
    if ~isfield(map, 'height_m')
        return
    end
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
            found(p) = [1 - t, t] * map.height_m(rows, columns) * [1 - s; s];
        end
    end
end

function [cell, share] = between(nodes, position)
% The cell that holds a position and the position's share of its width; none outside.
    cell = [];
    share = 0;
    if ~(nodes(1) <= position && position <= nodes(end))
        return
    end
    cell = max(min(sum(nodes <= position), numel(nodes) - 1), 1);
    if numel(nodes) > 1
        share = (position - nodes(cell)) / (nodes(cell + 1) - nodes(cell));
    end
end

function manifest = read_manifest(folder)
    path = fullfile(folder, 'manifest.json');
    if ~exist(path, 'file')
        error('fluxform:bundle', '%s is not a bundle: it has no manifest.json', folder);
    end
    manifest = jsondecode(text_of(path));
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

function text = listed(folder, known, name)
% The bytes of a file that the manifest lists, after checking size and digest.
    path = fullfile(folder, name);
    at = find(strcmp({known.path}, name));
    if numel(at) ~= 1
        error('fluxform:bundle', 'manifest.json must list %s once', name);
    end
    text = text_of(path);
    if numel(text) ~= known(at).bytes
        error('fluxform:bundle', '%s was changed or damaged: its size differs', path);
    end
    digest = sha256(text);
    if ~isempty(digest) && ~strcmpi(digest, known(at).sha256)
        error('fluxform:bundle', '%s was changed or damaged: its SHA-256 differs', path);
    end
end

function text = text_of(path)
    file = fopen(path, 'r');
    if file < 0
        error('fluxform:bundle', 'cannot read %s', path);
    end
    text = fread(file, [1, Inf], 'uint8=>char');
    fclose(file);
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
    numbers = reshape(numbers, numel(names), []).';
    for k = 1:numel(names)
        columns.(names{k}) = numbers(:, k);
    end
end

function map = read_npz(path)
% The arrays of an uncompressed zip of .npy files, by name.
    file = fopen(path, 'r', 'ieee-le');
    closing = onCleanup(@() fclose(file));
    fseek(file, -22, 'eof');                      % the end record, which has no comment
    if fread(file, 1, 'uint32') ~= hex2dec('06054b50')
        error('fluxform:bundle', '%s is not a zip file without a comment', path);
    end
    fseek(file, 6, 'cof');
    count = fread(file, 1, 'uint16');
    fseek(file, 4, 'cof');
    entry = fread(file, 1, 'uint32');             % where the first entry of the directory stands
    for k = 1:count
        fseek(file, entry, 'bof');
        head = fread(file, 46, 'uint8=>double');
        number = @(at, bytes) sum(head(at + (1:bytes)).' .* 256 .^ (0:bytes - 1));
        lengths = [number(28, 2), number(30, 2), number(32, 2)];
        name = fread(file, [1, lengths(1)], 'uint8=>char');
        if number(10, 2) ~= 0
            error('fluxform:bundle', '%s: %s is not stored as it is', path, name);
        end
        local = number(42, 4);
        fseek(file, local + 26, 'bof');
        skip = fread(file, 2, 'uint16');
        fseek(file, local + 30 + sum(skip), 'bof');
        map.(strrep(name, '.npy', '')) = read_npy(file, number(24, 4), name);
        entry = entry + 46 + sum(lengths);
    end
end

function values = read_npy(file, bytes, name)
% One array in C order as an array of the same indices, or a row where it has one dimension.
    magic = fread(file, 8, 'uint8=>double').';
    if ~isequal(magic, [147, double('NUMPY'), 1, 0])
        error('fluxform:bundle', '%s is not an NPY 1.0 array', name);
    end
    header_bytes = fread(file, 1, 'uint16');
    header = fread(file, [1, header_bytes], 'uint8=>char');
    found = regexp(header, ['''descr'': ''<(f8|i8)'', ''fortran_order'': False, ' ...
                            '''shape'': \(([0-9, ]*)\)'], 'tokens', 'once');
    if isempty(found)
        error('fluxform:bundle', '%s must hold numbers of 8 bytes in C order', name);
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
    coils = numel(map.current_max_a);
    if numel(bundle.currents_a) ~= coils
        error('fluxform:bundle', 'currents.csv must have one row a coil');
    end
    if any(map.coil < 0) || any(map.coil >= coils) || any(diff(map.coil) <= 0)
        error('fluxform:bundle', 'map.npz: coil must hold increasing indices of coils');
    end
    names = {'x_m', 'y_m', 'z_m'};
    for k = 1:3
        if any(diff(map.(names{k})) <= 0) || isempty(map.(names{k}))
            error('fluxform:bundle', 'map.npz: %s must increase from node to node', names{k});
        end
    end
    grid = [numel(map.z_m), numel(map.y_m), numel(map.x_m)];
    wanted = {'gz_t_per_m_per_a', [numel(map.coil), grid]; ...
              'gradient_t_per_m_per_a', [numel(map.coil), grid, 3, 3]; ...
              'passive_force_n', grid; 'moment_a_m2', [1, 3]};
    for k = 1:size(wanted, 1)
        if isfield(map, wanted{k, 1})
            shape = arrayfun(@(d) size(map.(wanted{k, 1}), d), 1:numel(wanted{k, 2}));
            if ~isequal(shape, wanted{k, 2})
                error('fluxform:bundle', 'map.npz: %s has the wrong shape', wanted{k, 1});
            end
        end
    end
    if any(map.moment_a_m2(1:2)) && ~isfield(map, 'gradient_t_per_m_per_a')
        error('fluxform:bundle', 'a tilted magnet needs gradient_t_per_m_per_a in map.npz');
    end
end
