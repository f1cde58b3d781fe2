% Trajectory, look-ahead and drive in Simulink's FMU Import block, from the folder that this line writes:
%
%     hybridsep build --machine spring_mass_damper --out fmus
%
% NOT RUN: no licence was at hand. A test holds the names and the order of the ports to the FMUs.
% docs/howto/simulink.md says what to look for. For the compensator see `lookAhead` below.

folder = 'fmus';
T_s = 0.001; % s, sampling interval of the machine
stopTime = 6.1; % s
lookAhead = 'HybridPredictor'; % or 'SepCompensator', whose command for the drive is x_dm
command = 'x_d';
if strcmp(lookAhead, 'SepCompensator')
    command = 'x_dm';
end

% Ports stand in the order of modelDescription.xml.
ports.ReferenceTrajectory.inputs = {};
ports.ReferenceTrajectory.outputs = {'r'};
ports.HybridPredictor.inputs = {'x_d_ahead', 'x_meas'};
ports.HybridPredictor.outputs = {'x_d', 'x_pb', 'x_h', 'x_h_std', 'e_servo', 'hybrid_active', 'rms_pb', 'rms_h', 'rms_hold', 'batch', 'n_rejected'};
ports.SepCompensator.inputs = {'x_d_ahead', 'x_meas', 'x_load'};
ports.SepCompensator.outputs = {'x_dm', 'x_d', 'x_pb', 'x_h', 'x_h_std', 'e_servo', 'sep_state', 'rms_e', 'rms_pb', 'rms_h', 'rms_hold', 'batch', 'n_rejected', 'no_measurement', 'alarm'};
ports.FeedDrive.inputs = {'x_d'};
ports.FeedDrive.outputs = {'x', 'v', 'x_meas'};

wires = {
    'ReferenceTrajectory', 'r', lookAhead, 'x_d_ahead'
    lookAhead, command, 'FeedDrive', 'x_d'
    'FeedDrive', 'x_meas', lookAhead, 'x_meas'
};
shown = {lookAhead, 'rms_h'; lookAhead, 'rms_pb'; 'FeedDrive', 'x'};

addpath(folder); % the block takes the name of a file on the path
model = 'hybridsep_loop';
new_system(model);
set_param(model, 'SolverType', 'Fixed-step', 'Solver', 'FixedStepDiscrete', 'FixedStep', num2str(T_s, 17), 'StopTime', num2str(stopTime, 17));
blocks = {'ReferenceTrajectory', lookAhead, 'FeedDrive'};
for i = 1:numel(blocks)
    block = [model '/' blocks{i}];
    add_block('simulink_extras/FMU Import/FMU', block, 'FMUName', [blocks{i} '.fmu'], 'Position', [300 * i, 40, 300 * i + 180, 340]);
    set_param(block, 'FMUInputMapping', 'Flat', 'FMUOutputMapping', 'Flat', 'FMUSampleTime', num2str(T_s, 17));
    handles = get_param(block, 'PortHandles');
    assert(numel(handles.Inport) == numel(ports.(blocks{i}).inputs), '%s: number of input ports', blocks{i});
    assert(numel(handles.Outport) == numel(ports.(blocks{i}).outputs), '%s: number of output ports', blocks{i});
end
port = @(block, kind, name) sprintf('%s/%d', block, find(strcmp(ports.(block).(kind), name)));
for i = 1:size(wires, 1)
    add_line(model, port(wires{i, 1}, 'outputs', wires{i, 2}), port(wires{i, 3}, 'inputs', wires{i, 4}), 'autorouting', 'on');
end
for i = 1:size(shown, 1)
    sink = [shown{i, 1} '_' shown{i, 2}];
    add_block('simulink/Sinks/To Workspace', [model '/' sink], 'VariableName', sink, 'Position', [1300, 60 * i, 1400, 60 * i + 30]);
    add_line(model, port(shown{i, 1}, 'outputs', shown{i, 2}), [sink '/1'], 'autorouting', 'on');
end
save_system(model);
result = sim(model);
values = result.get([lookAhead '_rms_h']);
% docs/evidence/importers.md has the figures of other tools
fprintf('rms_h at the end: %.4g um\n', 1e6 * values.Data(end));
