// xatlas behind its shim, with random meshes of every kind of trouble; built and run by tools/long_check.sh under
// AddressSanitizer and UndefinedBehaviorSanitizer.
//
// usage: xatlas SECONDS    prints how many meshes it unwrapped

#include "../src/atlas/xatlas_shim.cpp"

#include <chrono>
#include <cmath>
#include <cstdlib>

namespace {

struct Dice {
	uint64_t state;
	float unit()
	{
		state = state * 6364136223846793005ull + 1442695040888963407ull;
		return (float)((state >> 40) / (double)(1 << 24));
	}
	uint32_t below(uint32_t n) { return std::min((uint32_t)(unit() * n), n - 1); }
};

struct Shape {
	std::vector<float> position, normal;
	std::vector<uint32_t> index;
};

void vertex(Shape &shape, Dice &dice, float x, float y, float z)
{
	shape.position.insert(shape.position.end(), { x, y, z });
	float n[3] = { dice.unit() - 0.5f, dice.unit() - 0.5f, dice.unit() - 0.5f };
	const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
	// A zero normal now and then.
	const float scale = length > 1e-3f && dice.below(50) > 0 ? 1 / length : 0;
	shape.normal.insert(shape.normal.end(), { n[0] * scale, n[1] * scale, n[2] * scale });
}

// Few vertices and many triangles, so that edges have many sides; flattened, on a grid, far away.
Shape tangle(Dice &dice)
{
	Shape shape;
	const uint32_t vertices = 3 + dice.below(60), triangles = 1 + dice.below(200);
	const float stretch = std::pow(10.0f, -6 * dice.unit()), far = dice.below(4) == 0 ? 1e6f : 0;
	const bool grid = dice.below(2) == 0;
	for (uint32_t i = 0; i < vertices; i++) {
		float p[3] = { dice.unit() * 4, dice.unit() * 4, dice.unit() * 4 };
		for (float &x : p)
			x = grid ? std::floor(x) : x;
		vertex(shape, dice, p[0] + far, p[1] * stretch, p[2]);
	}
	for (uint32_t i = 0; i < 3 * triangles; i++)
		shape.index.push_back(dice.below(vertices));
	return shape;
}

// A crumpled sheet, perhaps closed to a tube, with holes and doubled triangles.
Shape sheet(Dice &dice)
{
	Shape shape;
	const uint32_t n = 2 + dice.below(24), wrap = dice.below(2);
	const float rough = std::pow(10.0f, 2 - 6 * dice.unit());
	for (uint32_t y = 0; y <= n; y++)
		for (uint32_t x = 0; x <= n; x++)
			vertex(shape, dice, (float)x, (float)y, dice.unit() * rough);
	for (uint32_t y = 0; y < n; y++)
		for (uint32_t x = 0; x < n; x++) {
			const uint32_t right = wrap ? (x + 1) % n : x + 1;
			const uint32_t a = x + (n + 1) * y, b = right + (n + 1) * y, c = a + n + 1, d = b + n + 1;
			for (uint32_t twice = 0; twice <= (dice.below(40) == 0); twice++)
				if (dice.below(30) > 0)
					shape.index.insert(shape.index.end(), { a, b, d, a, d, c });
		}
	if (shape.index.empty())
		shape.index.insert(shape.index.end(), { 0, 1, 2 });
	return shape;
}

// Counts down; says no at the end.
bool go_on(void *left) { return --*static_cast<int *>(left) > 0; }

} // namespace

int main(int count, char **arguments)
{
	const double seconds = count > 1 ? std::atof(arguments[1]) : 60;
	const auto begin = std::chrono::steady_clock::now();
	uint64_t meshes = 0, charts = 0, stopped = 0, failed = 0;
	while (std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() < seconds) {
		Dice dice = { ++meshes * 0x9e3779b97f4a7c15ull };
		const Shape shape = dice.below(2) ? tangle(dice) : sheet(dice);
		const uint32_t triangles = (uint32_t)shape.index.size() / 3;
		int patience = dice.below(8) == 0 ? 1 + (int)dice.below(20) : 1 << 30;
		Charts *found = nullptr;
		const int code = lightkiln_xatlas_charts((uint32_t)shape.position.size() / 3, shape.position.data(),
			shape.normal.data(), triangles, shape.index.data(), 4, 2, go_on, &patience, &found);
		if (code != 0) {
			(code == 1 ? stopped : failed)++;
			continue;
		}
		const uint32_t number = lightkiln_xatlas_chart_count(found), faces = lightkiln_xatlas_face_count(found);
		std::vector<uint32_t> first(number + 1), face(faces);
		std::vector<float> uv(6 * (size_t)faces);
		lightkiln_xatlas_copy(found, first.data(), face.data(), uv.data());
		lightkiln_xatlas_free(found);
		for (uint32_t f : face)
			if (f >= triangles)
				std::abort();
		charts += number;
	}
	fprintf(stderr, "%llu meshes: %llu charts, %llu stopped, %llu refused\n", (unsigned long long)meshes,
		(unsigned long long)charts, (unsigned long long)stopped, (unsigned long long)failed);
	return 0;
}
