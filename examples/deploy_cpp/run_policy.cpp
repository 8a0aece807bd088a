// Runs an exported policy in C++ from the contract in its ONNX file; the actions equal those of the Python loop.
//   apt install g++ libonnxruntime-dev nlohmann-json3-dev    # Debian since 13
//   g++ -std=c++17 -O2 run_policy.cpp -I/usr/include/onnxruntime -lonnxruntime -o run_policy
//   ./run_policy policy.onnx < readings.txt
// Input, one line for each control step: quaternion (w x y z, body to world), gyro (rad/s, body frame), joint positions
// (rad), joint velocities (rad/s), command (m/s, m/s, rad/s). Output: action, joint position targets (rad).
#include <algorithm>
#include <cmath>
#include <deque>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <onnxruntime_cxx_api.h>
#include <sstream>
using Vector = std::vector<double>;
void run(const char* path) {
    Ort::Env env(ORT_LOGGING_LEVEL_ERROR);
    Ort::SessionOptions options;
    options.SetIntraOpNumThreads(1);
    Ort::Session session(env, path, options);
    Ort::AllocatorWithDefaultOptions memory;
    const auto text = session.GetModelMetadata().LookupCustomMetadataMapAllocated("footfall.contract", memory);
    if (!text) throw std::runtime_error("the file has no footfall contract");
    const auto contract = nlohmann::json::parse(text.get());
    if (contract["version"] != 1) throw std::runtime_error("this program reads contracts of version 1");
    const Vector pose = contract["default_pose_rad"], scale = contract["action_scale_rad"];
    const size_t n = pose.size();
    const auto gait = contract["gait"].is_null() ? nlohmann::json::object() : contract["gait"];
    const double steps_per_cycle = contract["control_rate_hz"].get<double>() / gait.value("frequency_hz", 1.0);
    const auto commands = contract["commands"];
    const Vector range[] = {commands["forward_m_s"], commands["leftward_m_s"], commands["yaw_rad_s"]};
    const Vector offset = gait.value("phase", Vector(n)), amplitude = gait.value("amplitude_rad", Vector(n));
    std::map<std::string, std::deque<Vector>> history;  // latest values of each term, oldest first
    Vector action(n), line(4 + 3 + 2 * n + 3);
    std::string typed;
    for (long step = 0; std::getline(std::cin, typed); ++step) {
        std::istringstream numbers(typed);
        for (double& number : line) numbers >> number;
        if (!numbers || !(numbers >> std::ws).eof())  // numbers of another line would become other readings
            throw std::runtime_error("line " + std::to_string(step + 1) + ": expected " + std::to_string(line.size()) + " numbers");
        const double w = line[0], x = line[1], y = line[2], z = line[3];
        const auto position = line.begin() + 7, velocity = position + n, command = velocity + n;
        for (size_t j = 0; j < n; ++j) position[j] -= pose[j];
        for (int k = 0; k < 3; ++k) command[k] = std::clamp(command[k], range[k][0], range[k][1]);
        const bool moving = std::hypot(command[0], command[1], command[2]) >= contract["standing_command"];
        const double phase = gait.empty() ? 0.0 : std::fmod(step / steps_per_cycle, 1.0);
        std::map<std::string, Vector> terms{
            {"gyro", Vector(line.begin() + 4, position)},
            {"gravity", {2 * (w * y - x * z), -2 * (w * x + y * z), 2 * (x * x + y * y) - 1}},
            {"joint_position", Vector(position, velocity)}, {"joint_velocity", Vector(velocity, command)},
            {"command", Vector(command, line.end())}, {"last_action", action},
            {"clock", {moving * std::sin(2 * M_PI * phase), moving * std::cos(2 * M_PI * phase)}}};
        std::vector<float> input;  // term by term; within a term oldest step first
        for (const auto& term : contract["observation"]) {
            const auto found = terms.find(term["name"]);
            if (found == terms.end()) throw std::runtime_error("unknown term " + term["name"].dump());
            auto& kept = history[term["name"]];
            do kept.push_back(found->second); while (kept.size() < term["history"]);  // the first step fills the history
            if (kept.size() > term["history"]) kept.pop_front();
            for (const Vector& values : kept)
                for (double value : values) input.push_back(float(value * term["scale"].get<double>()));
        }
        const int64_t shape[] = {1, int64_t(input.size())};
        const auto tensor = Ort::Value::CreateTensor(memory.GetInfo(), input.data(), input.size(), shape, 2);
        const char *inputs[] = {"observation"}, *outputs[] = {"action"};
        const auto result = session.Run(Ort::RunOptions(), inputs, &tensor, 1, outputs, 1);
        for (size_t j = 0; j < n; ++j) std::printf("%.9g ", action[j] = result[0].GetTensorData<float>()[j]);
        for (size_t j = 0; j < n; ++j) {
            const double swing = std::fmod(phase + offset[j], 1.0) / (1.0 - gait.value("duty", 0.5));
            const double reference = swing < 1.0 ? moving * amplitude[j] * std::sin(M_PI * swing) : 0.0;
            std::printf("%.9g%c", pose[j] + reference + scale[j] * action[j], j + 1 < n ? ' ' : '\n');
        }
    }
}
int main(int count, char** arguments) try {
    run(count == 2 ? arguments[1] : throw std::runtime_error("give one argument, the policy's .onnx file"));
} catch (const std::exception& error) {
    std::cerr << arguments[0] << ": " << error.what() << "\n";
    return 2;
}
