% The slider of `peers` by NLvib under Octave: prints JSON. NLvib is made for teaching and research on nonlinear modes.
% Its friction is elastic with a limit that does not change, neither rigid nor that of a changing normal force.
% octave-cli -q peer_nlvib.m '{"source": "NLvib", ...}'
asked = jsondecode(argv(){end});
addpath([asked.source '/SRC'], [asked.source '/SRC/MechanicalSystems']);
friction = struct('type', 'elasticDryFriction', 'stiffness', asked.spring, ...
    'friction_limit_force', asked.friction, 'ishysteretic', true);
slider = SingleMassOscillator(asked.mass, asked.damping, asked.mount, {friction}, asked.force);
unknowns = 2 * asked.harmonics + 1;
first = 2 * pi * asked.first;
last = 2 * pi * asked.last;
% The first guess slides without friction: from a stuck one Newton's method stops where there is no solution.
free = asked.force / (asked.mount - first^2 * asked.mass + 1i * first * asked.damping);
start = zeros(unknowns, 1);
start(2:3) = [real(free); -imag(free)];
% Displacements in units of 10 um, a seventh of the first amplitude: in larger ones the first step turns back.
scales = struct('Dscale', [1e-5 * ones(unknowns, 1); first], 'stepadapt', 0);
newton = optimset('Display', 'off', 'Jacobian', 'on', 'MaxIter', 50); % NLvib's own are for MATLAB's optimset
for run = 1:2
    began = cputime;
    [points, effort] = solve_and_continue(start, @(x) HB_residual(x, slider, asked.harmonics, asked.samples), ...
        first, last, 0.8 * first, scales, {}, newton);
    spent = cputime - began;
end
disp(jsonencode(struct('frequency', points(end, :) / (2 * pi), 'amplitude', hypot(points(2, :), points(3, :)), ...
    'iterations', sum(effort.NIT), 'seconds', spent)));
