// The OpenAPI document as a page. The key that a reader enters stays in the memory of the page.
window.SwaggerUIBundle({
  url: "/openapi.json",
  dom_id: "#docs",
  deepLinking: true,
  validatorUrl: null, // asks another host otherwise
  persistAuthorization: false,
});
