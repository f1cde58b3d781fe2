within ;
package HybridSEP "Simulated drives of C.-H. Chou, M. Duan, C. E. Okwudire, CIRP Annals 70 (2021)"

  type Length = Real(final quantity = "Length", final unit = "m");
  type Velocity = Real(final quantity = "Velocity", final unit = "m/s");
  type Momentum = Real(final quantity = "Momentum", final unit = "N.s");
  type Time = Real(final quantity = "Time", final unit = "s");
  type Frequency = Real(final quantity = "Frequency", final unit = "Hz");

  connector LengthInput = input Length "Position into a block"
    annotation(Icon(graphics = {Polygon(points = {{-100, 100}, {100, 0}, {-100, -100}}, fillPattern = FillPattern.Solid)}));
  connector LengthOutput = output Length "Position out of a block"
    annotation(Icon(graphics = {Polygon(points = {{-100, 100}, {100, 0}, {-100, -100}}, lineColor = {0, 0, 0})}));
  connector VelocityOutput = output Velocity "Velocity out of a block"
    annotation(Icon(graphics = {Polygon(points = {{-100, 100}, {100, 0}, {-100, -100}}, lineColor = {0, 0, 0})}));

  package Noise "Gaussian noise: SplitMix64 (Steele, Lea, Flood 2014) and the transform of Box and Muller (1958)"

    constant Real word = 65536 "A number of 64 bits is four words of 16, the lowest first, which Real holds exactly";

    function xor "Exclusive or of two words"
      input Real a;
      input Real b;
      output Real c = 0;
    protected
      Real p = a;
      Real q = b;
      Real bit = 1;
    algorithm
      for i in 1:16 loop
        if abs(p - 2*floor(p/2) - (q - 2*floor(q/2))) > 0.5 then
          c := c + bit;
        end if;
        p := floor(p/2);
        q := floor(q/2);
        bit := 2*bit;
      end for;
    end xor;

    function shifted "A number without its lowest bits, 2^bits-th part"
      input Real z[4];
      input Integer bits "0 ... 63";
      output Real y[4];
    protected
      Integer words = div(bits, 16);
      Real low = 2.0^mod(bits, 16);
    algorithm
      for i in 1:4 loop
        y[i] := 0;
        if i + words <= 4 then
          y[i] := floor(z[i + words]/low);
        end if;
        if i + words + 1 <= 4 then
          y[i] := y[i] + (z[i + words + 1] - low*floor(z[i + words + 1]/low))*word/low;
        end if;
      end for;
    end shifted;

    function xorShifted "z xor z shifted"
      input Real z[4];
      input Integer bits;
      output Real y[4];
    protected
      Real s[4];
    algorithm
      s := shifted(z, bits);
      for i in 1:4 loop
        y[i] := xor(z[i], s[i]);
      end for;
    end xorShifted;

    function product "a b + c modulo 2^64"
      input Real a[4];
      input Real b[4];
      input Real c;
      output Real y[4];
    protected
      Real sum = c;
    algorithm
      for i in 1:4 loop
        for j in 1:i loop
          sum := sum + a[j]*b[i + 1 - j];
        end for;
        y[i] := sum - word*floor(sum/word);
        sum := floor(sum/word);
      end for;
    end product;

    function uniform "Number of 53 bits of the sequence of a seed, 0 ... 2^53 - 1"
      input Integer seed "0 ... 2^31 - 1";
      input Real index "0, 1, ...";
      output Real y;
    protected
      Real z[4];
      Real n = index + 1;
    algorithm
      // Words of 9E3779B97F4A7C15, BF58476D1CE4E5B9 and 94D049BB133111EB
      z := product({31765, 32586, 31161, 40503}, {n - word*floor(n/word), floor(n/word), 0, 0}, seed);
      z := product(xorShifted(z, 30), {58809, 7396, 18285, 48984}, 0);
      z := product(xorShifted(z, 27), {4587, 4913, 18875, 38096}, 0);
      z := shifted(xorShifted(z, 31), 11);
      y := z[1] + word*(z[2] + word*(z[3] + word*z[4]));
    end uniform;

    function normal "Normal number of a sample, mean 0, variance 1"
      input Integer seed "0 ... 2^31 - 1";
      input Real k "Number of the sample, 0, 1, ...";
      output Real y;
    protected
      constant Real twoPi = 6.283185307179586;
    algorithm
      y := sqrt(-2*log((uniform(seed, 2*k) + 1)/2.0^53))*cos(twoPi*uniform(seed, 2*k + 1)/2.0^53);
    end normal;

  end Noise;

  package Drives "Drives with the terminals of the plant FMUs: command, true position and velocity, measured position"

    partial model Drive "Command held over a sampling interval, and encoder"
      parameter Time T_s = 1e-3 "Sampling interval";
      parameter Length start = 0 "Position at rest";
      parameter Length noise_std = 0 "Standard deviation of the encoder's noise";
      parameter Integer seed = 0 "Seed of the noise, 0 ... 2^31 - 1";
      LengthInput x_d "Command" annotation(Placement(transformation(extent = {{-120, -10}, {-100, 10}})));
      LengthOutput x "True position" annotation(Placement(transformation(extent = {{100, 50}, {120, 70}})));
      VelocityOutput v "True velocity" annotation(Placement(transformation(extent = {{100, -10}, {120, 10}})));
      LengthOutput x_meas(start = start) "Measured position" annotation(Placement(transformation(extent = {{100, -70}, {120, -50}})));
    protected
      discrete Length x_k(start = start, fixed = true) "Command, held";
    equation
      when sample(0, T_s) then
        x_k = x_d;
        x_meas = x + noise_std*Noise.normal(seed, floor(time/T_s + 0.5));
      end when;
      annotation(Icon(graphics = {Rectangle(extent = {{-100, 100}, {100, -100}}), Text(extent = {{-90, 20}, {90, -20}}, textString = "%name")}));
    end Drive;

    model FeedDrive "Spring-mass-damper with quadratic damping and stiffness, eqs. (11) to (13)"
      extends Drive;
      parameter Real m(unit = "kg") = 1 "Mass";
      parameter Real c(unit = "N.s/m") = 15.7 "Damping";
      parameter Real k(unit = "N/m") = 24674 "Stiffness";
      parameter Real c_nl(unit = "N.s2/m2") = 100 "Quadratic damping: the printed 0.1, x in mm and force in kg.mm/s2";
      parameter Real k_nl(unit = "N/m2") = 1000 "Quadratic stiffness: the printed 1, likewise";
    protected
      Momentum p(start = 0, fixed = true) "Of mass and damper, finite where the command jumps";
      Real H_NL(unit = "N") "Nonlinear force";
    initial equation
      x = start;
    equation
      v = der(x);
      // Eq. (12)
      H_NL = c_nl*v*abs(v) + k_nl*(x - start)*abs(x - start);
      // Eq. (11): m x'' + c x' + k x + H_NL = k x_d + c x_d', once integrated
      p = m*v + c*(x - x_k);
      der(p) = k*(x_k - x) - H_NL;
    end FeedDrive;

    partial model ModalDrive "Sum of modes, eq. (15), of a disturbed command"
      extends Drive;
      parameter Frequency f_n[:] "Natural frequencies";
      parameter Real zeta[size(f_n, 1)](each unit = "1") "Damping ratios";
      parameter Real alpha[size(f_n, 1)](each unit = "1/s2") "Numerators at s^0";
      parameter Real beta[size(f_n, 1)](each unit = "1/s") "Numerators at s^1";
      parameter Length f = 0 "Friction as an offset of the command";
      parameter Real kappa(unit = "1/m") = 0 "Cable stiffness as an offset of the command";
      constant Velocity v_s = 2e-3 "Scale of the friction's change of sign";
    protected
      constant Real twoPi = 6.283185307179586;
      final parameter Integer M = size(f_n, 1) "Number of modes";
      Length y[M](each start = 0, each fixed = true) "Positions of the modes, their sum relative to start";
      Velocity w[M](each start = 0, each fixed = true) "What the modes' velocities have of the past";
      Length u "Disturbed command, relative to start";
      Velocity v_f "Velocity of the friction";
    equation
      u = x_k - start - f*tanh(v_f/v_s) - kappa*(x - start)*abs(x - start);
      for i in 1:M loop
        // Eq. (15): s^2 y + 2 zeta omega s y + omega^2 y = (alpha + beta s) u, in the observer's form
        der(y[i]) = w[i] + beta[i]*u - 2*zeta[i]*(twoPi*f_n[i])*y[i];
        der(w[i]) = alpha[i]*u - (twoPi*f_n[i])^2*y[i];
      end for;
      x = start + sum(y);
      v = sum(der(y));
    end ModalDrive;

    model Stage "Stage with friction of the commanded velocity"
      extends ModalDrive;
    protected
      discrete Velocity v_d(start = 0, fixed = true) "Commanded velocity, backward difference";
    equation
      when sample(0, T_s) then
        v_d = (x_d - pre(x_k))/T_s;
      end when;
      v_f = v_d;
    end Stage;

    model StageInMotion "Stage with friction of its own velocity, which must have one solution: -f sum(beta) < v_s"
      extends ModalDrive;
    equation
      assert(-f*sum(beta) < v_s, "-f sum(beta) must be below v_s, where the friction's equation has one solution");
      v_f = v;
    end StageInMotion;

  end Drives;

  package Machines "The machine files of these names"

    model SpringMassDamper = Drives.FeedDrive(noise_std = 5e-6) "Section 3 of the paper";

    model ALS25010X = Drives.Stage(
      noise_std = 1e-6, f = 1.4211e-5, kappa = 0.0213165,
      f_n = {20.52, 34.94, 42.53, 42.6}, zeta = {0.092, 0.54, 0.029, 0.007},
      alpha = {15797.5, -135160.6, 189225.5, 14633.4}, beta = {54.3, -587.7, -60.5, -67.9}) "X axis, Table 1 of the paper";

    model ALS25010Y = Drives.Stage(
      noise_std = 1e-6, f = 7.8377e-5, kappa = 0.1175655,
      f_n = {17.86, 25.7, 30.66, 43.1}, zeta = {0.12, 0.021, 0.44, 0.036},
      alpha = {6709.0, 42872.2, -43178.2, -966.3}, beta = {310.4, 169.4, -1260.2, 7.5}) "Y axis, Table 1 of the paper";

  end Machines;

  model Samples "Command from samples"
    parameter Time T_s = 1e-3 "Sampling interval";
    parameter Length samples[:] "Commands";
    LengthOutput r(start = samples[1]) "Command, held" annotation(Placement(transformation(extent = {{100, -10}, {120, 10}})));
  equation
    when sample(0, T_s) then
      r = samples[min(integer(floor(time/T_s + 0.5)) + 1, size(samples, 1))];
    end when;
    annotation(Icon(graphics = {Rectangle(extent = {{-100, 100}, {100, -100}}), Text(extent = {{-90, 20}, {90, -20}}, textString = "%name")}));
  end Samples;

  model Example "Sine of 10 mm and 1 Hz on the drive of section 3"
    Machines.SpringMassDamper drive annotation(Placement(transformation(extent = {{-10, -10}, {10, 10}})));
    Length e "Tracking error";
  equation
    drive.x_d = 10e-3*sin(6.283185307179586*time);
    e = drive.x_d - drive.x;
    annotation(experiment(StopTime = 2, Interval = 1e-3, Tolerance = 1e-9));
  end Example;

end HybridSEP;
