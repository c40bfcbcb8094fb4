% One wheel, closed form with sinkage a state, by ode45: reads problem.json, writes motion.txt
% (speed m/s, wheel speed rad/s at every sample), prints the seconds that ode45 took.
1;

function dy = motion(t, y, p, torque)
  v = y(1); omega = y(2); z = y(3); z_rate = y(4);
  k = min(floor(t / p.dt), numel(torque) - 2) + 1;
  T = torque(k) + (t / p.dt - (k - 1)) * (torque(k + 1) - torque(k));
  fade = max(-1, min(1, v / p.fade));
  if z > 0
    l = sqrt((2 * p.r - z) * z);
    N = p.b * l * (p.k * z ^ p.n + p.D * max(z_rate, 0));
    rim = p.r * omega;
    slip = (rim - v) / max([abs(rim), abs(v), p.fade]);
    u = min(1, abs(slip)) * l / p.K;
    kappa = 1;
    if u > 0
      kappa = -expm1(-u) / u;
    end
    F = sign(slip) * (p.c * p.b * l + N * p.tan_phi) * (1 - kappa);
    R = fade * N * z / ((p.n + 1) * l);
  else
    N = 0; F = 0; R = 0;
  end
  ramp = 1;
  if p.ramp > 0
    ramp = min(1, t / p.ramp);
  end
  pull = fade * ramp * (p.pull + p.pull_per_speed * abs(v));
  dy = [(F - R - pull) / p.m; (T - p.r * F) / p.J; z_rate; p.g - N / p.m];
end

p = jsondecode(fileread('problem.json'));
torque = p.torque;
times = p.dt * (0:numel(torque) - 1)';
options = odeset('RelTol', p.rtol);
tic;
[~, y] = ode45(@(t, y) motion(t, y, p, torque), times, p.start, options);
took = toc;
dlmwrite('motion.txt', y(:, 1:2), 'delimiter', ' ', 'precision', 17);
printf('%.6f\n', took);
