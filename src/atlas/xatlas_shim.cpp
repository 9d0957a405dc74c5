// The one door to xatlas. Its source file is included, not linked, because only its internals hold the charts as they
// were flattened: the public output exists after packing alone, which is done elsewhere and would stretch, turn and
// mirror the charts. The package that brings the file is pinned to one exact version.

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <vector>

namespace {
// xatlas prints warnings by default; a library must not.
int silent(const char *, ...) { return 0; }
} // namespace

#define printf silent
#include "xatlas.cpp"
#undef printf

namespace {

struct Charts {
	std::vector<uint32_t> first_face; // Of each chart, and the end.
	std::vector<uint32_t> face; // Index into the triangles.
	std::vector<float> corner_uv; // Six per face.
};

typedef bool (*Continue)(void *user);

struct Asker {
	Continue go_on;
	void *user;
	bool stopped;
};

bool progress(xatlas::ProgressCategory, int, void *user)
{
	Asker *asker = static_cast<Asker *>(user);
	if (!asker->stopped && !asker->go_on(asker->user))
		asker->stopped = true;
	return !asker->stopped;
}

struct Handle {
	xatlas::Atlas *atlas;
	Handle() : atlas(xatlas::Create()) {}
	~Handle() { xatlas::Destroy(atlas); }
};

void collect(const xatlas::internal::param::Atlas &found, Charts *out)
{
	out->first_face.push_back(0);
	for (uint32_t g = 0; g < found.chartGroupCount(0); g++) {
		const xatlas::internal::param::ChartGroup *group = found.chartGroupAt(0, g);
		for (uint32_t c = 0; c < group->chartCount(); c++) {
			const xatlas::internal::param::Chart *chart = group->chartAt(c);
			const xatlas::internal::Mesh *flat = chart->unifiedMesh();
			for (uint32_t f = 0; f < flat->faceCount(); f++) {
				out->face.push_back(chart->mapFaceToSourceFace(f));
				for (uint32_t k = 0; k < 3; k++) {
					const xatlas::internal::Vector2 &uv = flat->texcoord(flat->vertexAt(f * 3 + k));
					out->corner_uv.push_back(uv.x);
					out->corner_uv.push_back(uv.y);
				}
			}
			out->first_face.push_back((uint32_t)out->face.size());
		}
	}
}

} // namespace

extern "C" {

// Cuts a mesh into charts and flattens them: `position` and `normal` have three numbers a vertex, `index` three a
// triangle. Returns 0, 1 when go_on said no, 2 on any failure. On 0 the result must be given to lightkiln_xatlas_free.
int lightkiln_xatlas_charts(uint32_t vertices, const float *position, const float *normal, uint32_t triangles,
	const uint32_t *index, float normal_seam_weight, float max_cost, Continue go_on, void *user, Charts **result)
{
	*result = nullptr;
	Charts *charts = nullptr;
	try {
		Asker asker = { go_on, user, false };
		Handle handle;
		xatlas::SetProgressCallback(handle.atlas, progress, &asker);
		xatlas::MeshDecl mesh;
		mesh.vertexPositionData = position;
		mesh.vertexPositionStride = 3 * sizeof(float);
		mesh.vertexNormalData = normal;
		mesh.vertexNormalStride = 3 * sizeof(float);
		mesh.vertexCount = vertices;
		mesh.indexData = index;
		mesh.indexCount = triangles * 3;
		mesh.indexFormat = xatlas::IndexFormat::UInt32;
		if (xatlas::AddMesh(handle.atlas, mesh, 1) != xatlas::AddMeshError::Success)
			return 2;
		xatlas::AddMeshJoin(handle.atlas);
		xatlas::ChartOptions options;
		options.normalSeamWeight = normal_seam_weight;
		options.maxCost = max_cost;
		xatlas::ComputeCharts(handle.atlas, options);
		const xatlas::Context *context = reinterpret_cast<const xatlas::Context *>(handle.atlas);
		if (asker.stopped)
			return 1;
		if (!context->paramAtlas.chartsComputed())
			return 2;
		charts = new Charts;
		collect(context->paramAtlas, charts);
		*result = charts;
		return 0;
	} catch (...) {
		delete charts;
		return 2;
	}
}

uint32_t lightkiln_xatlas_chart_count(const Charts *charts) { return (uint32_t)charts->first_face.size() - 1; }
uint32_t lightkiln_xatlas_face_count(const Charts *charts) { return (uint32_t)charts->face.size(); }

// `first_face` takes one more than there are charts, `face` one and `corner_uv` six numbers a face.
void lightkiln_xatlas_copy(const Charts *charts, uint32_t *first_face, uint32_t *face, float *corner_uv)
{
	std::copy(charts->first_face.begin(), charts->first_face.end(), first_face);
	std::copy(charts->face.begin(), charts->face.end(), face);
	std::copy(charts->corner_uv.begin(), charts->corner_uv.end(), corner_uv);
}

void lightkiln_xatlas_free(Charts *charts) { delete charts; }

} // extern "C"
