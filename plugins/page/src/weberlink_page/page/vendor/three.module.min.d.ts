// For the check of types only: everything of three may be anything.
export const BackSide: any, BoxGeometry: any, BufferAttribute: any, BufferGeometry: any, CanvasTexture: any;
export const ConeGeometry: any, CylinderGeometry: any, DirectionalLight: any, DoubleSide: any, EdgesGeometry: any;
export const Float32BufferAttribute: any, FrontSide: any, Group: any, HemisphereLight: any, Line: any;
export const LineBasicMaterial: any, LineSegments: any, MathUtils: any, Mesh: any, MeshBasicMaterial: any;
export const MeshLambertMaterial: any, PerspectiveCamera: any, Plane: any, PlaneGeometry: any, Points: any;
export const PointsMaterial: any, Raycaster: any, Scene: any, SphereGeometry: any, Spherical: any, Vector2: any;
export const Vector3: any, WebGLRenderer: any, WireframeGeometry: any;
