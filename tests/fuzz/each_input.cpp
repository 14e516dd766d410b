// Stands in for libFuzzer in the ordinary build: every input of a corpus, cut short at each of 64 places, and
// with each of 64 of its bits turned, so that a target that no longer builds or no longer holds is seen at
// once.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s CORPUS\n", argv[0]);
    return 2;
  }
  constexpr std::size_t kPlaces = 64;
  int inputs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(argv[1])) {
    std::ifstream file(entry.path(), std::ios::binary);
    std::vector<std::uint8_t> input{std::istreambuf_iterator<char>(file), {}};
    (void)LLVMFuzzerTestOneInput(input.data(), input.size());
    for (std::size_t i = 0; i < kPlaces && !input.empty(); ++i) {
      const std::size_t place = i * input.size() / kPlaces;
      (void)LLVMFuzzerTestOneInput(input.data(), place);
      const auto bit = static_cast<std::uint8_t>(1U << i % 8);
      input[place] ^= bit;
      (void)LLVMFuzzerTestOneInput(input.data(), input.size());
      input[place] ^= bit;
    }
    ++inputs;
  }
  std::printf("%d inputs\n", inputs);
  return inputs > 0 ? 0 : 1;
}
