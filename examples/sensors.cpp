// Writes one wingwatch.v1.Sensors message (proto/wingwatch/v1/vehicle.proto) as protobuf bytes, without any library:
// for a microcontroller, or to see how little there is to it. With a protobuf compiler, generate the classes from the schema instead.
//
//     g++ -std=c++17 -o sensors examples/sensors.cpp && ./sensors > sensors.bin
//
// Send the bytes to the key wingwatch/v1/<fleet>/<vehicle>/sensors with the encoding application/protobuf (zenoh-c, zenoh-cpp or
// zenoh-pico). Announce the aircraft first: key .../aircraft, application/json, {"aircraft": "aerosonde"}.
#include <cstdint>
#include <cstring>
#include <iostream>
#include <string>
#include <vector>

namespace {

// Field numbers of SensorColumns; the schema promises never to change one.
enum Column { time_s = 1, airspeed_true_m_s = 2, pitch_rate_rad_s = 5, specific_force_z_m_s2 = 9, elevator_rad = 13, angle_of_attack_rad = 16 };

void put_varint(std::string &out, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) out.push_back(static_cast<char>(value | 0x80));
  out.push_back(static_cast<char>(value));
}

void put_bytes(std::string &out, unsigned field, const std::string &bytes) {
  put_varint(out, field << 3 | 2); // wire type 2: a length and that many bytes
  put_varint(out, bytes.size());
  out += bytes;
}

void put_column(std::string &out, Column column, const std::vector<double> &values) {
  std::string packed(8 * values.size(), '\0'); // repeated doubles are packed, little-endian
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::uint64_t bits;
    std::memcpy(&bits, &values[i], sizeof bits);
    for (int byte = 0; byte < 8; ++byte) packed[8 * i + byte] = static_cast<char>(bits >> 8 * byte);
  }
  put_bytes(out, column, packed);
}

} // namespace

int main() {
  std::string columns;
  put_column(columns, time_s, {0.00, 0.02, 0.04}); // SI units and radians, one value a sample
  put_column(columns, airspeed_true_m_s, {25.0, 25.1, 25.2});
  put_column(columns, pitch_rate_rad_s, {0.01, 0.02, 0.03});
  put_column(columns, specific_force_z_m_s2, {-9.81, -9.80, -9.79});
  put_column(columns, elevator_rad, {-0.02, -0.02, -0.01});
  put_column(columns, angle_of_attack_rad, {0.05, 0.05, 0.06});

  std::string message;
  put_varint(message, 1 << 3 | 0); // sequence: counts messages from 0
  put_varint(message, 17);
  put_bytes(message, 2, columns);
  put_varint(message, 3 << 3 | 0); // stream: any number that is new at each start
  put_varint(message, 20261129);
  std::cout.write(message.data(), static_cast<std::streamsize>(message.size()));
  return std::cout.good() ? 0 : 1;
}
