// The one door to xatlas. Its source file is included, not linked, because only its internals hold the charts as they
// were flattened: the public output exists after packing alone, which is done elsewhere and would stretch, turn and
// mirror the charts. The package that brings the file is pinned to one exact version.

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <new>
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
	std::vector<uint32_t> mesh; // Of each chart.
	std::vector<uint32_t> first_face; // Of each chart, and the end.
	std::vector<uint32_t> face; // Index into the mesh's triangles.
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

void collect(const xatlas::internal::param::Atlas &found, uint32_t meshes, Charts *out)
{
	out->first_face.push_back(0);
	for (uint32_t m = 0; m < meshes; m++) {
		for (uint32_t g = 0; g < found.chartGroupCount(m); g++) {
			const xatlas::internal::param::ChartGroup *group = found.chartGroupAt(m, g);
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
				out->mesh.push_back(m);
				out->first_face.push_back((uint32_t)out->face.size());
			}
		}
	}
}

} // namespace

extern "C" {

// Cuts and flattens `meshes` meshes. Vertex rows of mesh m are [first_vertex[m], first_vertex[m + 1]), likewise for
// indices, which count from the mesh's first vertex. Returns 0, 1 when go_on said no, 2 on any failure. On 0 the
// result must be given to lightkiln_xatlas_free.
int lightkiln_xatlas_charts(uint32_t meshes, const uint32_t *first_vertex, const float *position, const float *normal,
	const uint32_t *first_index, const uint32_t *index, float normal_seam_weight, float max_cost, Continue go_on,
	void *user, Charts **result)
{
	*result = nullptr;
	Charts *charts = nullptr;
	try {
		Asker asker = { go_on, user, false };
		Handle handle;
		xatlas::SetProgressCallback(handle.atlas, progress, &asker);
		for (uint32_t m = 0; m < meshes; m++) {
			xatlas::MeshDecl mesh;
			mesh.vertexPositionData = position + 3 * (size_t)first_vertex[m];
			mesh.vertexPositionStride = 3 * sizeof(float);
			mesh.vertexNormalData = normal + 3 * (size_t)first_vertex[m];
			mesh.vertexNormalStride = 3 * sizeof(float);
			mesh.vertexCount = first_vertex[m + 1] - first_vertex[m];
			mesh.indexData = index + first_index[m];
			mesh.indexCount = first_index[m + 1] - first_index[m];
			mesh.indexFormat = xatlas::IndexFormat::UInt32;
			if (xatlas::AddMesh(handle.atlas, mesh, meshes) != xatlas::AddMeshError::Success)
				return asker.stopped ? 1 : 2;
		}
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
		collect(context->paramAtlas, meshes, charts);
		*result = charts;
		return 0;
	} catch (...) {
		delete charts;
		return 2;
	}
}

uint32_t lightkiln_xatlas_chart_count(const Charts *charts) { return (uint32_t)charts->mesh.size(); }
uint32_t lightkiln_xatlas_face_count(const Charts *charts) { return (uint32_t)charts->face.size(); }

// Rows: `mesh` one per chart, `first_face` one more than charts, `face` one and `corner_uv` six per face.
void lightkiln_xatlas_copy(const Charts *charts, uint32_t *mesh, uint32_t *first_face, uint32_t *face, float *corner_uv)
{
	std::copy(charts->mesh.begin(), charts->mesh.end(), mesh);
	std::copy(charts->first_face.begin(), charts->first_face.end(), first_face);
	std::copy(charts->face.begin(), charts->face.end(), face);
	std::copy(charts->corner_uv.begin(), charts->corner_uv.end(), corner_uv);
}

void lightkiln_xatlas_free(Charts *charts) { delete charts; }

} // extern "C"
