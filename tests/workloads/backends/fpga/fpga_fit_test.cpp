// What is offered fits the device, by the table that synthesize.sh writes: for these cores, within
// the device's parts, and as fast as the board's clock.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <map>
#include <sstream>

#include "tests/support/paths.h"
#include "workloads/backends/fpga/fpga_options.h"

namespace pirt {
namespace {

const std::string kFolder = std::string(test::kSourceFolder) + "/workloads/backends/fpga";

struct Part {
  double alms = 0, dsp = 0, m10k = 0, slowest_ps = 0, mhz = 0;
};

struct Fit {
  std::string cores;  ///< Hash of their sources.
  std::map<std::string, Part> parts;
};

Fit read_fit() {
  Fit fit;
  std::ifstream file(kFolder + "/fit.txt");
  EXPECT_TRUE(file) << "synthesize.sh writes it";
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    std::string name;
    words >> name;
    if (name == "cores") {
      words >> fit.cores;
    } else if (name != "tool" && name != "top") {
      Part& part = fit.parts[name];
      words >> part.alms >> part.dsp >> part.m10k >> part.slowest_ps >> part.mhz;
    }
  }
  return fit;
}

std::string hash_of_cores() {
  const std::string command =
      "cd '" + kFolder + "' && export LC_ALL=C && cat cores/*.v | sha256sum | cut -c1-16";
  std::FILE* const pipe = ::popen(command.c_str(), "r");
  std::array<char, 64> text{};
  EXPECT_NE(std::fgets(text.data(), text.size(), pipe), nullptr);
  EXPECT_EQ(::pclose(pipe), 0);
  std::string hash = text.data();
  return hash.substr(0, hash.find('\n'));
}

TEST(FpgaFit, IsOfTheseCores) {
  EXPECT_EQ(read_fit().cores, hash_of_cores()) << "synthesize.sh was not run since they changed";
}

// Both bitstreams of de1-soc: what they have together, not each core alone.
TEST(FpgaFit, OfEachBitstreamIsWithinTheDevice) {
  const Fit fit = read_fit();
  const Part device = fit.parts.at("5CSEMA5");
  const double clock_mhz = fpga_options().front().standard;
  for (const char* top : {"vision", "mac_array"}) {
    SCOPED_TRACE(top);
    const Part part = fit.parts.at(top);
    EXPECT_LE(part.alms, 0.85 * device.alms);
    EXPECT_LE(part.dsp, device.dsp);
    EXPECT_LE(part.m10k, device.m10k);
    EXPECT_GE(part.mhz, clock_mhz);
  }
}

}  // namespace
}  // namespace pirt
